import shlex
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnet.cli import main
from dnet.commands.evaluate import Evaluate
from dnet.commands.evaluate_paper import Paper
from dnet.commands.record import Record
from dnet.commands.reproduce import command_of
from dnet.commands.reproduction import UNSEEN_SHAPES, Size, plan
from dnet.commands.train import Train

SCALES = st.floats(1e-6, 1.0)


def commands(out: Path, scale: float) -> dict[str, object]:
    return {one.name: command_of(one.line) for one in plan(out, scale, seed=0, workers=2)}


def test_scale_1_is_the_paper() -> None:
    assert Size.of(1.0) == Size(episodes=150, shapes=200, unseen_episodes=25)
    assert Size.of(1.0).unseen_episodes * UNSEEN_SHAPES == 100


@given(scale=SCALES, more=SCALES)
def test_a_larger_scale_has_no_less_of_anything(scale: float, more: float) -> None:
    small, large = map(Size.of, sorted((scale, more)))
    assert small.episodes <= large.episodes
    assert small.shapes <= large.shapes
    assert small.unseen_episodes <= large.unseen_episodes


@given(scale=st.floats(0.002, 1.0))
def test_the_number_of_shapes_is_proportional_to_the_scale(scale: float) -> None:
    size = Size.of(scale)
    assert size.episodes * size.shapes == pytest.approx(30_000 * scale, rel=0.13)


def test_every_line_is_a_command_at_any_scale(tmp_path: Path) -> None:
    for scale in (1e-6, 0.02, 1.0):
        assert len(commands(tmp_path, scale)) == len(plan(tmp_path, scale, seed=0, workers=2))


def test_a_directory_with_a_blank_is_one_word(tmp_path: Path) -> None:
    first = commands(tmp_path / "my results", 0.02)["data"]
    assert isinstance(first, Record)
    assert str(first.out) == str(tmp_path / "my results" / "data")


def test_what_a_stage_takes_is_what_those_before_it_leave(tmp_path: Path) -> None:
    left: set[str] = set()
    for stage in plan(tmp_path, 0.02, seed=0, workers=1):
        paths = {word for word in shlex.split(stage.line) if word.startswith(str(tmp_path))}
        new = paths - left
        assert len(new - {str(tmp_path / "runs")}) == 1, "one directory, where it writes"
        left |= new


def test_nothing_learns_from_the_unseen_data(tmp_path: Path) -> None:
    found = commands(tmp_path, 0.02)
    recordings = [one for one in found.values() if isinstance(one, Record)]
    trainings = [one for one in found.values() if isinstance(one, Train)]
    assert len({one.seed for one in recordings}) == 2
    assert {str(one.from_mcap) for one in trainings} == {str(tmp_path / "data")}
    assert {one.model for one in trainings} == {"deformernet", "hu", "grasp", "dense", "keypoints"}


def test_the_report_is_made_with_the_networks_that_were_trained(tmp_path: Path) -> None:
    evaluation = commands(tmp_path, 0.02)["report"]
    assert isinstance(evaluation, Evaluate)
    report = evaluation.experiment
    assert isinstance(report, Paper)
    runs = tmp_path / "runs"
    found = [report.checkpoint, report.keypoints, report.regressor, report.dense]
    assert found == [runs / name for name in ("deformernet", "keypoints", "grasp", "dense")]
    assert report.runs == runs


@pytest.mark.parametrize(("option", "value"), [("--scale", 0.0), ("--workers", 0), ("--seed", -1)])
def test_an_option_out_of_range_is_refused(tmp_path: Path, option: str, value: float) -> None:
    with pytest.raises(SystemExit) as refused:
        main(["reproduce", "--out", str(tmp_path / "out"), option, str(value)])
    assert f"{option} is {value}" in str(refused.value.code)
    assert not (tmp_path / "out").exists()
