"""Many runs are the same on any number of processes, and a finished one is not done again."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from dnet.cli import main
from dnet.errors import MissingPath, NoGoals
from dnet.evaluation.servo_scores import read_score
from dnet.laboratory import LaboratorySettings
from dnet.trials.batch import goals_in, missing, run_trials
from dnet.trials.request import Trial

LAB = LaboratorySettings(points=512, world="quasistatic")


def trials(out: Path, *goals: str) -> list[Trial]:
    plain = Trial("", out, controller="oracle", laboratory=LAB, recording=False)
    return [replace(plain, goal=goal, out=out / str(n)) for n, goal in enumerate(goals)]


def bytes_of(asked: list[Trial]) -> list[bytes]:
    return [(one.out / "run.mcap").read_bytes() for one in asked]


def test_processes_write_what_one_process_writes(tmp_path: Path) -> None:
    goals = ("random:1", "random:2")
    alone, shared = trials(tmp_path / "alone", *goals), trials(tmp_path / "shared", *goals)
    for asked, jobs in ((alone, 1), (shared, 2)):
        reports = list(run_trials(asked, jobs=jobs, stop=bool))
        assert sorted(report.trial.out.name for report in reports) == ["0", "1"]
        assert {report.outcome for report in reports} == {"converged"}
    assert bytes_of(alone) == bytes_of(shared)


def test_what_is_finished_is_not_done_again_and_what_was_left_is_cleared(tmp_path: Path) -> None:
    asked = trials(tmp_path, "random:1", str(tmp_path / "gone.mcap"))
    outcomes = [report.outcome for report in run_trials(asked, jobs=1, stop=bool)]
    assert outcomes == ["converged", "refused"]
    assert missing(asked) == asked[1:]
    why = json.loads((asked[1].out / "refused.json").read_text())["error"]
    assert "gone.mcap does not exist" in why
    assert read_score(asked[1].out).outcome == "refused"
    (asked[0].out / "run.mcap").rename(asked[0].out / "run.mcap.part")
    assert missing(asked) == asked
    list(run_trials(asked[:1], jobs=1, stop=bool))
    assert not (asked[0].out / "run.mcap.part").exists()
    assert missing(asked) == asked[1:]


def test_a_stop_begins_no_more(tmp_path: Path) -> None:
    asked = trials(tmp_path, "random:1", "random:2")
    assert list(run_trials(asked, jobs=1, stop=lambda: True)) == []


def test_the_goals_of_a_directory_are_its_episodes_and_clouds(tmp_path: Path) -> None:
    for name in ("b.mcap", "a.ply", "a.npy", "notes.txt", "c.mcap.part"):
        (tmp_path / name).touch()
    names = [name for name, _ in goals_in(tmp_path)]
    assert names == ["a.npy", "a.ply", "b"]


def test_a_directory_without_goals_is_refused(tmp_path: Path) -> None:
    with pytest.raises(NoGoals, match="holds no goal"):
        goals_in(tmp_path)
    with pytest.raises(MissingPath):
        goals_in(tmp_path / "gone")


def test_the_command_servoes_to_every_goal_and_prints_a_table(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data, out = tmp_path / "data", tmp_path / "runs"
    main(["record", str(data), "--pairs", "2", "--shapes", "1", "--world", "quasistatic"])
    command = ["servo", "--goals", str(data), "--out", str(out), "--controller", "oracle"]
    command += ["--world", "quasistatic"]
    main(command)
    assert sorted(path.name for path in out.iterdir()) == ["episode-0-00000", "episode-0-00001"]
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*")}
    capsys.readouterr()
    main(command)
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*")} == before
    assert capsys.readouterr().out.count("converged") == 2
