"""Every figure of a table follows from the clouds in the logs."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dnet.cli import main
from dnet.datasets.reader import EpisodeReader
from dnet.errors import NoSuchEpisode, TooFew
from dnet.evaluation.servo_goals import draw_goals
from dnet.evaluation.servo_scores import Score, read_score
from dnet.evaluation.servo_table import servo_frame, servo_table, summary
from dnet.geometry.chamfer import chamfer, legacy_chamfer

NAN = float("nan")


@pytest.fixture(scope="module")
def evaluated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("servo") / "eval"
    evaluate(out)
    return out


def evaluate(out: Path) -> None:
    controllers = ["--controllers", "none", "oracle"]
    main(["evaluate", "servo", "--goals", "2", *controllers, "--out", str(out)])


def score(outcome: str = "converged", *, last: float = 0.001, floor: float = 0.001) -> Score:
    return Score("g", outcome, 2, 0.011, last, floor, 0.5, 0.05, 0.04, 0.02, 0.003, 0.001, 40.0)


def test_a_score_is_what_the_clouds_of_the_log_say(evaluated: Path) -> None:
    for folder in (*(evaluated / "none").iterdir(), *(evaluated / "oracle").iterdir()):
        found = read_score(folder)
        with EpisodeReader(folder / "run.mcap") as run:
            goal = run.target()
            assert goal is not None
            last = run.cloud(len(run) - 1)
            assert found.last == chamfer(last, goal.cloud)
            assert found.legacy_last == legacy_chamfer(last, goal.cloud)
            assert found.first == pytest.approx(run.steps()[0]["chamfer"])
            assert found.outcome == (run.result or {})["outcome"]


def test_nothing_improves_nothing_and_the_oracle_everything(evaluated: Path) -> None:
    nothing = [read_score(folder) for folder in (evaluated / "none").iterdir()]
    oracle = [read_score(folder) for folder in (evaluated / "oracle").iterdir()]
    assert all(one.improvement == 0.0 and not one.most for one in nothing)
    assert all(one.near and one.most for one in oracle)
    assert {one.goal for one in nothing} == {one.goal for one in oracle}


def test_the_table_has_a_row_a_controller_and_the_files_the_same_figures(evaluated: Path) -> None:
    lines = (evaluated / "servo.md").read_text().splitlines()
    assert [line.split(" | ")[0] for line in lines[2:]] == ["| none", "| oracle"]
    assert len({line.count("|") for line in lines}) == 1
    figures = json.loads((evaluated / "servo.json").read_text())
    assert figures["oracle"]["near"] == 1.0
    assert len((evaluated / "servo.csv").read_text().splitlines()) == 5


def test_a_second_call_runs_nothing(evaluated: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in evaluated.rglob("run.mcap")}
    evaluate(evaluated)
    assert {path: path.stat().st_mtime_ns for path in evaluated.rglob("run.mcap")} == before


def test_runs_that_never_began_count(tmp_path: Path) -> None:
    (tmp_path / "refused.json").write_text('{"error": "no"}')
    refused = read_score(tmp_path)
    assert refused.outcome == "refused"
    figures = summary([score(), refused])
    assert figures["near"] == figures["most"] == 0.5
    assert figures["outcomes"] == {"converged": 1, "refused": 1}
    assert figures["last_mm"] == 1.0
    assert "1 converged, 1 refused" in servo_table([("x", [score(), refused])])
    assert servo_frame([("x", [score(), refused])]).height == 2


def test_near_and_most_are_measured_from_the_floor() -> None:
    assert score(last=0.0015).near
    assert not score(last=0.0016).near
    assert score(last=0.0029).most
    assert not score(last=0.0031).most
    assert not replace(score(), floor=NAN).near
    assert not replace(score(), floor=NAN).most


def test_the_legacy_norm_is_one_sided_and_no_mean() -> None:
    goal = np.zeros((4, 3), np.float32)
    current = np.array([[0.1, 0, 0], [9, 9, 9]], np.float32)
    assert legacy_chamfer(current, goal) == pytest.approx(0.2)


def test_goals_are_drawn_from_each_episode_in_turn(tmp_path: Path) -> None:
    main(["record", str(tmp_path), "--pairs", "2", "--shapes", "2", "--world", "quasistatic"])
    goals = draw_goals(tmp_path, [], count=4, seed=0)
    assert len(set(goals)) == 4
    assert {goal.rsplit(":", 1)[0] for goal in goals[:2]} == {
        str(tmp_path / f"episode-0-0000{n}.mcap") for n in (0, 1)
    }
    assert goals == draw_goals(tmp_path, [], count=4, seed=0)
    assert all(":0" not in goal[-2:] for goal in goals), "the rest shape is no goal"
    with pytest.raises(TooFew, match="settled shapes"):
        draw_goals(tmp_path, [], count=5, seed=0)
    with pytest.raises(NoSuchEpisode):
        draw_goals(tmp_path, ["episode-9"], count=1, seed=0)
