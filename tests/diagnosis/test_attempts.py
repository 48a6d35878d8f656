"""What works, fails, crashes or hangs is told apart, and none of it takes the others along."""

import pytest

from dnet.diagnosis import attempts
from dnet.diagnosis.abilities import Ability


def ability(how: str, *modules: str) -> Ability:
    return Ability(how, ("record",), modules, f"tests.diagnosis.broken:{how}", "one")


def test_a_crash_a_fault_and_a_hang_take_nothing_along(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(attempts, "SECONDS", 3.0)
    ways = ("works", "crashes", "fails", "hangs")
    told = []
    found = attempts.try_all(
        abilities=[ability(way) for way in ways], on_outcome=lambda: told.append(1)
    )
    assert [one.status for one in found] == ["works", "fails", "fails", "fails"]
    assert [one.note for one in found] == [
        "it works",
        "crashes: SIGILL",
        "it does not work",
        "hangs: not done within 3 s",
    ]
    assert len(told) == len(ways)


def test_what_lacks_a_package_is_not_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(attempts, "is_installed", lambda _: False)
    (found,) = attempts.try_all(abilities=[ability("crashes", "rerun_cli")])
    assert (found.status, found.note) == ("missing", "not installed: rerun-sdk")
    assert found.remedy.startswith('pip install "rerun-sdk')
