import json
from pathlib import Path

import pytest
import tyro

from dnet.commands.inspect import Info, Inspect, List
from dnet.errors import BadEpisode, NoEpisodes
from tests.recorders.rollout import frames, write, write_servo


def run(*arguments: str | Path) -> None:
    tyro.cli(Inspect, args=[str(argument) for argument in arguments]).run()


def test_its_words_are_ls_and_info() -> None:
    assert tyro.cli(Inspect, args=["ls", "data"]) == Inspect(List("data"))
    assert tyro.cli(Inspect, args=["info", "a.mcap"]) == Inspect(Info("a.mcap"))


def test_ls_prints_a_row_an_episode_and_the_sums(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path / "a.mcap", frames(2))
    write(tmp_path / "b.mcap", frames(4))
    run("ls", tmp_path)
    header, first, second, sums = capsys.readouterr().out.splitlines()
    assert header.split() == ["episode", "frames", "shapes", "points", "seconds", "MB", "finished"]
    assert first.split()[:5] == ["a", "3", "1", "64", "1.00"]
    assert second.split()[:5] == ["b", "7", "3", "64", "3.00"]
    assert sums.startswith("2 of 2 episodes finished, 4 shapes")


def test_ls_and_info_speak_to_machines(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path / "a.mcap", frames(4))
    run("ls", tmp_path, "--json")
    (listed,) = json.loads(capsys.readouterr().out)
    assert (listed["episode"], listed["frames"], listed["finished"]) == ("a", 7, True)
    run("ls", tmp_path, "--csv")
    header, row = capsys.readouterr().out.splitlines()
    assert dict(zip(header.split(","), row.split(","), strict=True))["shapes"] == "3"
    run("info", path, "--json")
    told = json.loads(capsys.readouterr().out)
    assert told["summary"]["result.rejected.folded"] == 2
    assert [frame["kind"] for frame in told["frames"]] == [one.kind for one in frames(4)]


def test_ls_goes_on_past_a_broken_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path / "b.mcap", frames(2))
    (tmp_path / "a.mcap").write_bytes(b"\x89MCAP0\r\n and no more")
    run("ls", tmp_path)
    out = capsys.readouterr().out
    assert "cut off in the middle" in out
    assert "1 of 2 episodes finished, 1 shapes" in out


def test_ls_of_nothing_says_how_to_record(tmp_path: Path) -> None:
    with pytest.raises(NoEpisodes, match="dnet record"):
        run("ls", tmp_path)


def test_info_prints_the_summary_and_every_frame(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run("info", write_servo(tmp_path / "run.mcap"))
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["episode", "run"]
    assert any(line.split() == ["result.outcome", "converged"] for line in lines)
    start = next(number for number, line in enumerate(lines) if line.startswith("frame"))
    assert [line.split()[:2] for line in lines[start + 1 :]] == [
        ["0", "rest"],
        ["1", "shape"],
        ["2", "shape"],
    ]


def test_info_of_a_cut_off_file_says_so(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", frames(2))
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(BadEpisode, match=r"a\.mcap is cut off in the middle"):
        run("info", path)
