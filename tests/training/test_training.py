import math
from dataclasses import replace
from itertools import islice

import pytest
import torch

from dnet.errors import OtherStream
from dnet.nets.deformernet import DeformerNet
from dnet.nets.pointconv import Norm
from dnet.training.examples import stream_of
from dnet.training.frames import Frames
from dnet.training.objectives import MotionError
from dnet.training.parallel import Process
from dnet.training.settings import TrainingSettings
from dnet.training.tasks import new_network
from dnet.training.training import Training, Weights
from tests.training.deforming_box import SMALL, box_frames

SETTINGS = TrainingSettings(epochs=2, groups=1, frames=3)


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Frames:
    return box_frames(tmp_path_factory.mktemp("boxes"), [0, 1, 2], samplings=2)


def begin(
    frames: Frames,
    settings: TrainingSettings = SETTINGS,
    *,
    workers: int = 0,
    seconds: float = math.inf,
) -> Training:
    stream = stream_of(frames, settings, process=Process(), workers=workers)
    return Training(
        MotionError(new_network(SMALL, seed=settings.seed)),
        stream,
        settings,
        seconds=seconds,
    )


def run(training: Training) -> list[float]:
    """Train to the end and return the loss of every batch."""
    losses = []
    while training.progress < 1:
        losses += [step.loss for step in training.epoch()]
        training.close_epoch()
    return losses


def same(one: Weights, other: Weights) -> bool:
    return one.keys() == other.keys() and all(torch.equal(one[name], other[name]) for name in one)


def weights(training: Training) -> tuple[Weights, Weights]:
    return training.model.state_dict(), training.average.state_dict()


def test_the_same_seed_gives_the_same_weights_and_another_seed_others(frames: Frames) -> None:
    one, again = begin(frames), begin(frames, workers=2)
    other = begin(frames, replace(SETTINGS, seed=1))
    assert run(one) == run(again) != run(other)
    for got, want in zip(weights(again), weights(one), strict=True):
        assert same(got, want)
    assert not same(one.model.state_dict(), other.model.state_dict())


@pytest.mark.parametrize("batches", [1, 5, 6, 8])
def test_a_training_goes_on_as_if_it_had_never_been_put_down(frames: Frames, batches: int) -> None:
    whole = begin(frames)
    losses = run(whole)
    first = begin(frames)
    begun: list[float] = []
    while len(begun) < batches:
        begun += [step.loss for step in islice(first.epoch(), batches - len(begun))]
        if first.stream.batch == 0:
            first.close_epoch()
    second = begin(frames, workers=2)
    second.load(first.tensors(), first.facts())
    assert begun + run(second) == losses
    for got, want in zip(weights(second), weights(whole), strict=True):
        assert same(got, want)
    assert second.steps == whole.steps == len(losses) == 12


def test_other_data_or_another_order_are_not_gone_on_with(frames: Frames) -> None:
    training = begin(frames)
    next(training.epoch())
    for other in (
        begin(frames, replace(SETTINGS, seed=1)),
        begin(Frames.of(frames.table.where(frames.table.file < 2), SMALL, samplings=2)),
    ):
        with pytest.raises(OtherStream):
            other.load(training.tensors(), training.facts())


def test_averaged_weights_follow_the_trained_ones(frames: Frames) -> None:
    training = begin(frames)
    before = DeformerNet(SMALL)
    before.load_state_dict(training.model.state_dict())
    steps = training.epoch()
    next(steps)
    assert same(training.average.state_dict(), training.model.state_dict())
    next(steps)
    for name, average in training.average.state_dict().items():
        now = training.model.state_dict()[name]
        assert not average.is_floating_point() or average.shape == now.shape
    assert not same(training.average.state_dict(), training.model.state_dict())


def test_whoever_asks_for_an_end_gets_it_after_the_batch(frames: Frames) -> None:
    training = begin(frames)
    steps = 0
    for _ in training.epoch():
        steps += 1
        if steps == 2:
            training.stop()
    # The batch that was on its way when the end was asked for is learned from.
    assert steps == training.steps == 3
    assert training.stopped


def test_time_ends_a_training_and_no_time_at_all_still_learns_from_one_batch(
    frames: Frames,
) -> None:
    training = begin(frames, replace(SETTINGS, epochs=10**6), seconds=0.5)
    run(training)
    assert training.progress == 1
    hurried = begin(frames, seconds=1e-9)
    assert len(run(hurried)) == 1


@pytest.mark.parametrize(("epochs", "batches"), [(0.1, 1), (0.5, 3), (1.5, 9), (2, 12)])
def test_part_of_an_epoch_is_so_many_of_its_batches(
    frames: Frames, epochs: int | float, batches: int
) -> None:
    assert len(run(begin(frames, replace(SETTINGS, epochs=epochs)))) == batches


def test_progress_only_grows(frames: Frames) -> None:
    training = begin(frames)
    progress = [0.0]
    while training.progress < 1:
        progress += [step.progress for step in training.epoch()]
        training.close_epoch()
    assert progress == sorted(progress)
    assert progress[-1] == 1


def test_the_curve_of_an_epoch_averages_to_its_loss(frames: Frames) -> None:
    training = begin(frames)
    losses = [step.loss for step in training.epoch()]
    mean, curve = training.close_epoch()
    assert mean == pytest.approx(sum(losses) / len(losses))
    assert curve == pytest.approx(losses)


@pytest.mark.parametrize("norm", ["group", "batch"])
def test_either_norm_learns_and_low_precision_learns_about_the_same(
    tmp_path_factory: pytest.TempPathFactory, norm: Norm
) -> None:
    config = replace(SMALL, norm=norm)
    boxes = box_frames(tmp_path_factory.mktemp("boxes"), [0, 1, 2, 3], config=config)
    settings = TrainingSettings(epochs=20, groups=2, frames=3, rest_share=0.0)
    training = begin(boxes, settings)
    losses = run(training)
    assert sum(losses[-12:]) < 0.7 * sum(losses[:12])
    assert training.encodings == 20 * len(boxes.table)
    rough = begin(boxes, replace(settings, precision="bfloat16"))
    first = [step.loss for step in rough.epoch()]
    assert first == pytest.approx(losses[: len(first)], rel=0.1)
    assert first != losses[: len(first)]
