"""Two processes that write into one directory: the second one is told, the first goes on."""

from dataclasses import replace
from pathlib import Path

import pytest

from dnet.cli import main
from dnet.errors import OccupiedOutput, OutputInUse, Unwritten
from dnet.files.one_writer import one_writer
from dnet.laboratory import LaboratorySettings
from dnet.trials.batch import run_trials
from dnet.trials.request import Trial
from tests.recorders import rollout

TOLD = "another process writes into .*; wait for it, or choose another directory"


def test_a_second_writer_is_told_and_a_third_may_write_when_the_first_is_done(
    tmp_path: Path,
) -> None:
    run = tmp_path / "run"
    with one_writer(run):
        with pytest.raises(OutputInUse, match=TOLD), one_writer(run):
            pass
        (run / "result").touch()
    with one_writer(run):
        pass
    assert [path.name for path in run.iterdir()] == ["result"]


def test_who_writes_nothing_leaves_no_directory_behind(tmp_path: Path) -> None:
    with one_writer(tmp_path / "new"):
        pass
    with one_writer(tmp_path):
        pass
    assert not list(tmp_path.iterdir())


def test_a_place_that_cannot_be_written_to_is_named(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.touch()
    with pytest.raises(OccupiedOutput), one_writer(file):
        pass
    with pytest.raises(Unwritten, match="nothing can be written into"), one_writer(file / "run"):
        pass


def test_a_second_training_is_told_and_changes_nothing(tmp_path: Path) -> None:
    rollout.write(tmp_path / "data" / "episode-0.mcap", rollout.frames(3, points=128))
    asked = ["train", "--from-mcap", f"{tmp_path / 'data'}", "--out", f"{tmp_path / 'run'}"]
    for more in ([], ["--resume"]):
        with one_writer(tmp_path / "run"), pytest.raises(SystemExit, match=TOLD):
            main([*asked, *more])
    assert not (tmp_path / "run").exists()


def test_a_second_servo_run_is_told_and_removes_nothing_of_the_first(tmp_path: Path) -> None:
    part = tmp_path / "run" / "run.mcap.part"
    part.parent.mkdir()
    part.touch()
    trial = Trial("random:1", part.parent, laboratory=LaboratorySettings(points=512))
    with one_writer(part.parent), pytest.raises(OutputInUse, match=TOLD):
        list(run_trials([replace(trial, controller="oracle")], jobs=1, stop=bool))
    assert part.exists()
    with one_writer(tmp_path / "new"), pytest.raises(SystemExit, match=TOLD):
        main(["servo", "--goal", "random", "--controller", "none", "--out", f"{tmp_path / 'new'}"])
