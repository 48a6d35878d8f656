import json
from pathlib import Path
from typing import Any

import pytest
import torch

from dnet.training import loop
from dnet.training.checkpoints import load
from dnet.training.examples import stream_of
from dnet.training.frames import Frames
from dnet.training.loop import HeldOut, fit
from dnet.training.objectives import MotionError
from dnet.training.parallel import Process
from dnet.training.progress import EpochDone, StepDone
from dnet.training.run import RunWriter
from dnet.training.scores import errors_of
from dnet.training.settings import TrainingSettings
from dnet.training.tasks import new_network
from dnet.training.training import Training, Weights
from tests.training.deforming_box import SMALL, box_frames

SETTINGS = TrainingSettings(epochs=3, groups=1, frames=3)
CONTENT: dict[str, Any] = {"network": {}, "training": {}, "data": {}}


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Frames:
    return box_frames(tmp_path_factory.mktemp("boxes"), [0, 1, 2])


@pytest.fixture(scope="module")
def held_out(tmp_path_factory: pytest.TempPathFactory) -> HeldOut:
    shapes, episodes = (box_frames(tmp_path_factory.mktemp("held"), [seed]) for seed in (7, 8))
    return HeldOut(shapes, episodes)


def begin(frames: Frames, settings: TrainingSettings = SETTINGS) -> Training:
    stream = stream_of(frames, settings, process=Process())
    return Training(MotionError(new_network(SMALL, seed=settings.seed)), stream, settings)


def same(one: Weights, other: Weights) -> bool:
    return one.keys() == other.keys() and all(torch.equal(one[name], other[name]) for name in one)


def untimed(run: Path) -> list[dict[str, Any]]:
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    return [{k: v for k, v in one.items() if k not in ("seconds", "waited")} for one in lines]


def test_first_weights_are_a_function_of_the_seed_and_leave_the_global_generator_alone() -> None:
    torch.manual_seed(5)
    before = torch.random.get_rng_state()
    one, again, other = (new_network(SMALL, seed=seed).state_dict() for seed in (0, 0, 1))
    assert torch.equal(torch.random.get_rng_state(), before)
    assert same(one, again)
    assert not same(one, other)


def test_training_learns_motions_of_an_object_that_it_has_not_seen(
    frames: Frames, held_out: HeldOut, tmp_path: Path
) -> None:
    run = RunWriter(tmp_path, CONTENT)
    fit(begin(frames, TrainingSettings(epochs=40, groups=1, frames=3)), held_out, run=run)
    losses = [line["loss"] for line in run.history]
    assert losses[-1] < losses[0] / 2
    errors = run.history[-1]["unseen_episodes"]["any_pair"]
    assert run.least < errors["zero_mse_mm2"] / 2


def test_the_best_network_is_that_of_the_least_error_on_unseen_episodes(
    frames: Frames, held_out: HeldOut, tmp_path: Path
) -> None:
    run = RunWriter(tmp_path, CONTENT)
    seen: list[tuple[float, Weights]] = []
    # So fast that epochs get worse again.
    training = begin(frames, TrainingSettings(epochs=6, groups=1, frames=3, learning_rate=0.1))

    def keep(event: StepDone | EpochDone) -> None:
        if isinstance(event, EpochDone):
            network = {name: one.clone() for name, one in training.average.state_dict().items()}
            seen.append((event.unseen_episodes.main.mse_mm2, network))
            assert event.best == (seen[-1][0] == min(error for error, _ in seen))

    fit(training, held_out, run=run, on_event=keep)
    assert same(load(tmp_path).state_dict(), min(seen, key=lambda pair: pair[0])[1])
    assert same(load(tmp_path / "last.safetensors").state_dict(), seen[-1][1])
    errors = errors_of(load(tmp_path), held_out.unseen_episodes)
    assert errors is not None
    assert errors.main.mse_mm2 == pytest.approx(run.least)


def test_events_tell_every_step_and_every_epoch(
    frames: Frames, held_out: HeldOut, tmp_path: Path
) -> None:
    events: list[StepDone | EpochDone] = []
    fit(begin(frames), held_out, run=RunWriter(tmp_path, CONTENT), on_event=events.append)
    steps = [(event.epoch, event.step) for event in events if isinstance(event, StepDone)]
    assert steps == [(epoch, step) for epoch in (1, 2, 3) for step in range(1, 7)]
    epochs = [event for event in events if isinstance(event, EpochDone)]
    assert [event.steps for event in epochs] == [6, 12, 18]
    assert [event.progress for event in epochs] == pytest.approx([1 / 3, 2 / 3, 1])


@pytest.mark.parametrize("stop_at", [(1, 2), (2, 6), (3, 1)])
def test_a_training_that_was_stopped_goes_on_exactly(
    frames: Frames, held_out: HeldOut, tmp_path: Path, stop_at: tuple[int, int]
) -> None:
    fit(begin(frames), held_out, run=RunWriter(tmp_path / "whole", CONTENT))
    training = begin(frames)

    def stop(event: StepDone | EpochDone) -> None:
        if isinstance(event, StepDone) and (event.epoch, event.step) == stop_at:
            training.stop()

    fit(training, held_out, run=RunWriter(tmp_path / "parts", CONTENT), on_event=stop)
    assert 0 < training.progress < 1
    run = RunWriter(tmp_path / "parts", CONTENT, resume=True)
    again = begin(frames)
    assert run.take_up(again)
    fit(again, held_out, run=run)
    assert untimed(tmp_path / "parts") == untimed(tmp_path / "whole")
    for name in ("best", "last"):
        one, other = (load(tmp_path / run / f"{name}.safetensors") for run in ("parts", "whole"))
        assert same(one.state_dict(), other.state_dict())


def test_a_training_is_put_down_every_so_often(
    frames: Frames, held_out: HeldOut, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A kill, which nothing can react to, loses what was learned since."""
    monkeypatch.setattr(loop, "SAVE_SECONDS", 0.0)

    class Killed(BaseException):
        pass

    def kill(event: StepDone | EpochDone) -> None:
        if isinstance(event, StepDone) and (event.epoch, event.step) == (2, 4):
            raise Killed

    with pytest.raises(Killed):
        fit(begin(frames), held_out, run=RunWriter(tmp_path, CONTENT), on_event=kill)
    again = begin(frames)
    assert RunWriter(tmp_path, CONTENT, resume=True).take_up(again)
    assert again.steps == 9
