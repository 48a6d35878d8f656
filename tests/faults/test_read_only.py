"""A directory that takes no file: each command says so in one line, and reads it all the same.

The directory is a file system that is mounted read-only: modes do not count for root.
"""

from pathlib import Path

import pytest

from dnet.cli import main
from dnet.datasets.index import open_index
from dnet.training.checkpoints import load
from tests.faults.children import elsewhere
from tests.recorders import rollout

QUICK = ("--world", "quasistatic")


def read_only(source: Path, place: Path) -> str:
    return (
        f"mount -t tmpfs tmpfs '{place}'; cp '{source}'/* '{place}'; "
        f"mount -o remount,ro,bind '{place}' || mount -o remount,ro '{place}'"
    )


def write_nothing(folder: str, writable: str) -> None:
    place = Path(folder)
    before = {path: path.stat().st_mtime_ns for path in place.rglob("*")}
    out, data = str(place / "out"), str(place)
    for asked in (
        ["record", out, "--pairs", "1", "--shapes", "1", *QUICK],
        ["record", data, "--pairs", "1", "--shapes", "1", *QUICK],
        ["train", "--from-mcap", data, "--out", out, "--device", "cpu", "--epochs", "1"],
        ["servo", "--goal", "random", "--controller", "none", "--out", out, *QUICK],
        ["servo", "--goals", data, "--controller", "none", "--out", out, *QUICK],
        ["inspect", "export", data, "--to", "npz", "--out", out],
        ["inspect", "plot", data, "--out", f"{out}.png"],
    ):
        with pytest.raises(SystemExit) as ended:
            main(asked)
        line = str(ended.value)
        assert line.startswith("dnet: "), asked
        assert "\n" not in line
        assert data in line
        if asked != ["record", data, *asked[2:]]:
            assert "Read-only file system" in line, (asked, line)
    assert open_index(place).frames.height == 15
    run = Path(writable) / "run"
    main(["train", "--from-mcap", data, "--out", str(run), "--device", "cpu", "--epochs", "1"])
    assert load(run).config.points == 128
    assert {path: path.stat().st_mtime_ns for path in place.rglob("*")} == before


@pytest.mark.slow
def test_each_command_names_it_and_a_training_reads_it(tmp_path: Path) -> None:
    data, place = tmp_path / "data", tmp_path / "place"
    for number in range(3):
        rollout.write(data / f"e-{number}.mcap", rollout.frames(3, seed=number, points=128))
    place.mkdir()
    elsewhere(
        write_nothing,
        place,
        tmp_path,
        mount=read_only(data, place),
        environment={"XDG_CACHE_HOME": str(tmp_path / "cache")},
    )
