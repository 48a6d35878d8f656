"""SIGKILL in the middle of each command: what is there can be read, and the command goes on."""

import json
from pathlib import Path

import psutil
import pytest

from dnet.cli import main
from dnet.datasets.index import INDEX, open_index
from dnet.datasets.index_file import unpack_index
from dnet.datasets.reader import EpisodeReader
from dnet.tools.validate import validate
from tests.faults.children import killed
from tests.recorders import rollout
from tests.recording.synthetic import contents

QUICK = ("--world", "quasistatic")
MANY = 80
"""Episodes that take long enough to read for a kill to come in between."""


@pytest.fixture(scope="module")
def many(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("many")
    seen = rollout.frames(3, points=256)
    for number in range(MANY):
        rollout.write(folder / f"episode-{number:03d}.mcap", seen)
    return folder


def saved(part: Path, out: Path) -> EpisodeReader:
    """What `dnet inspect repair` saves of a recording without an end."""
    main(["inspect", "repair", str(part), "--out", str(out)])
    (episode,) = out.glob("*.mcap")
    assert faults(out) == []
    return EpisodeReader(episode)


def faults(folder: Path) -> list[str]:
    """What a validation finds wrong with the episodes that have their name."""
    found = validate(sorted(folder.glob("*.mcap"))).findings
    return [str(one) for one in found if one.severity == "error" and one.check != "unfinished"]


def test_a_killed_recording_goes_on_to_the_bytes_of_an_undisturbed_one(tmp_path: Path) -> None:
    asked = ["--pairs", "3", "--shapes", "2", "--points", "64", *QUICK]
    data = tmp_path / "data"
    part = data / "episode-0-00001.mcap.part"
    killed(
        "record",
        data,
        *asked,
        log=tmp_path / "log",
        at=lambda _: part.exists() and b"frame 1: shape" in part.read_bytes(),
    )
    assert [path.name for path in data.glob("*.mcap")] == ["episode-0-00000.mcap"]
    assert faults(data) == []
    with saved(part, tmp_path / "saved") as episode:
        assert not episode.finished
        assert list(episode.kinds)[:2] == ["rest", "shape"]
    for folder in (data, tmp_path / "undisturbed"):
        main(["record", str(folder), *asked])
    assert contents(data) == contents(tmp_path / "undisturbed")


@pytest.mark.slow
def test_a_killed_servo_run_keeps_its_steps_and_a_batch_goes_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    goals, runs = tmp_path / "goals", tmp_path / "runs"
    goals.mkdir()
    main(["record", str(goals), "--pairs", "2", "--shapes", "1", *QUICK])
    asked = ["servo", "--goals", str(goals), "--out", str(runs), "--controller", "rrt", *QUICK]
    asked += ["--steps", "8", "--chamfer", "0"]
    first, second = (runs / f"episode-0-0000{number}" for number in range(2))
    steps = second / "latency.jsonl"
    killed(
        *asked,
        log=tmp_path / "log",
        at=lambda _: steps.exists() and len(steps.read_bytes().splitlines()) >= 3,
    )
    whole = (first / "run.mcap").read_bytes()
    assert not (second / "run.mcap").exists()
    with saved(second / "run.mcap.part", tmp_path / "saved") as run:
        assert len(run.steps()) >= 3
        assert len(run) >= 3
    one = ["servo", "--goal", "random", "--out", str(second), "--controller", "none"]
    with pytest.raises(SystemExit, match=r"already holds a run \(run\.mcap\.part\)"):
        main(one)
    main(asked)
    assert (first / "run.mcap").read_bytes() == whole
    assert faults(first) == faults(second) == []
    assert not list(runs.rglob("*.part"))
    assert "2 runs in" in capsys.readouterr().out


@pytest.mark.slow
def test_a_killed_demo_goes_on_with_the_step_under_way(tmp_path: Path) -> None:
    demo, log = tmp_path / "demo", tmp_path / "log"
    asked = ["demo", "--out", str(demo), "--pairs", "2", "--shapes", "3", "--epochs", "30"]

    def done() -> list[str]:
        return list(json.loads((demo / "demo.json").read_text())["seconds"])

    killed(*asked, log=log, at=lambda _: (demo / "train" / "metrics.jsonl").exists())
    assert done() == ["record", "list"]
    killed(*asked, log=log, at=lambda _: (demo / "servo" / "run.mcap.part").exists())
    assert done() == ["record", "list", "train"]
    main(asked)
    assert len(done()) == 7
    assert faults(demo / "servo") == []
    assert not list(demo.rglob("*.part"))


def test_a_killed_index_leaves_nothing_and_is_made_again(many: Path, tmp_path: Path) -> None:
    def reads(process: int) -> bool:
        maps = psutil.Process(process).memory_maps()
        return any(one.path.startswith(str(many)) for one in maps)

    killed("inspect", "ls", many, log=tmp_path / "log", at=reads)
    left = {path.name for path in many.iterdir() if path.suffix != ".mcap"}
    assert left == set()
    assert open_index(many).frames.height == MANY * 5
    files, frames = unpack_index((many / INDEX).read_bytes(), most=MANY)
    assert (files.height, frames.height) == (MANY, MANY * 5)


def test_a_killed_export_has_no_name_yet_and_is_begun_again(many: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    part = tmp_path / "out.part"
    asked = ["inspect", "export", str(many), "--to", "npz", "--out", str(out)]
    killed(*asked, log=tmp_path / "log", at=lambda _: any(part.glob("*.npz")))
    assert not out.exists()
    assert 0 < len(list(part.glob("*.npz"))) < MANY
    with pytest.raises(SystemExit, match=r"out\.part already holds an unfinished export"):
        main(asked)
    for path in part.iterdir():
        path.unlink()
    part.rmdir()
    main(asked)
    assert len(list(out.glob("*.npz"))) == MANY
