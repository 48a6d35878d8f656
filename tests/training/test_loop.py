import math
from dataclasses import replace

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from dnet.errors import TooFew
from dnet.nets.deformernet import DeformerNet
from dnet.training.frames import Frames
from dnet.training.loop import (
    EpochDone,
    Result,
    StepDone,
    TrainingSettings,
    Weights,
    fit,
    learning_rate_at,
    new_network,
)
from tests.training.deforming_box import SMALL, box_frames

SHORT = TrainingSettings(epochs=2)


@pytest.fixture(scope="module")
def training() -> Frames:
    return box_frames([0, 1, 2])


@pytest.fixture(scope="module")
def validation() -> Frames:
    return box_frames([10])


def train(training: Frames, validation: Frames, settings: TrainingSettings = SHORT) -> Result:
    model = new_network(SMALL, seed=settings.seed)
    return fit(model, training, validation=validation, settings=settings)


def same(one: Weights, other: Weights) -> bool:
    return one.keys() == other.keys() and all(torch.equal(one[name], other[name]) for name in one)


def test_the_same_seed_gives_the_same_weights_and_another_seed_others(
    training: Frames, validation: Frames
) -> None:
    first = train(training, validation)
    again = train(training, validation)
    other = train(training, validation, replace(SHORT, seed=1))
    assert same(first.last, again.last)
    assert [done.loss_mm2 for done in first.history] == [done.loss_mm2 for done in again.history]
    assert not same(first.last, other.last)


def test_first_weights_are_a_function_of_the_seed_and_leave_the_global_generator_alone() -> None:
    torch.manual_seed(5)
    before = torch.random.get_rng_state()
    one, again, other = (new_network(SMALL, seed=seed).state_dict() for seed in (0, 0, 1))
    assert torch.equal(torch.random.get_rng_state(), before)
    assert same(one, again)
    assert not same(one, other)


@pytest.mark.parametrize("augmented", [True, False])
def test_training_learns_motions_of_an_object_that_it_has_not_seen(
    validation: Frames, augmented: bool
) -> None:
    settings = TrainingSettings(epochs=20)
    settings = settings if augmented else replace(settings, augmentation=None)
    history = train(box_frames([0, 1, 2, 3]), validation, settings).history
    best = min(done.validation.any_pair.mse_mm2 for done in history)
    assert history[-1].loss_mm2 < history[0].loss_mm2 / 2
    assert best < history[-1].validation.any_pair.zero_mse_mm2 / 2


def test_the_best_weights_are_those_of_the_least_validation_error(
    training: Frames, validation: Frames
) -> None:
    model = new_network(SMALL, seed=0)
    seen: list[tuple[float, Weights]] = []

    def keep(event: StepDone | EpochDone) -> None:
        if isinstance(event, EpochDone):
            weights = {name: tensor.clone() for name, tensor in model.state_dict().items()}
            seen.append((event.validation.any_pair.mse_mm2, weights))
            assert event.best == (event.validation.any_pair.mse_mm2 == min(e for e, _ in seen))

    # So fast that epochs get worse again.
    settings = TrainingSettings(epochs=5, learning_rate=0.02)
    result = fit(model, training, validation=validation, settings=settings, on_event=keep)
    assert same(result.best, min(seen, key=lambda pair: pair[0])[1])
    assert same(result.last, seen[-1][1])
    assert not result.interrupted


def test_an_interrupt_keeps_the_last_whole_epoch(training: Frames, validation: Frames) -> None:
    model = new_network(SMALL, seed=0)
    kept: list[Weights] = []

    def interrupt(event: StepDone | EpochDone) -> None:
        if isinstance(event, EpochDone):
            kept.append({name: tensor.clone() for name, tensor in model.state_dict().items()})
        elif event.epoch == 3:
            raise KeyboardInterrupt

    settings = TrainingSettings(epochs=9)
    result = fit(model, training, validation=validation, settings=settings, on_event=interrupt)
    assert result.interrupted
    assert [done.epoch for done in result.history] == [1, 2]
    assert same(result.last, kept[1])
    assert not same(result.last, model.state_dict())


def test_an_interrupt_before_the_first_epoch_is_over_leaves_nothing(
    training: Frames, validation: Frames
) -> None:
    def interrupt(event: StepDone | EpochDone) -> None:
        raise KeyboardInterrupt

    model = new_network(SMALL, seed=0)
    with pytest.raises(KeyboardInterrupt):
        fit(model, training, validation=validation, settings=SHORT, on_event=interrupt)


def test_time_ends_a_training_that_its_epochs_would_not(
    training: Frames, validation: Frames
) -> None:
    model = new_network(SMALL, seed=0)
    settings = TrainingSettings(epochs=10**6)
    result = fit(model, training, validation=validation, settings=settings, seconds=1.5)
    assert 1 <= len(result.history) < 1000
    assert result.history[-1].progress == 1
    assert not result.interrupted


def test_no_time_at_all_still_learns_from_one_batch(training: Frames, validation: Frames) -> None:
    model = new_network(SMALL, seed=0)
    before = {name: tensor.clone() for name, tensor in model.state_dict().items()}
    steps: list[StepDone | EpochDone] = []
    fit(
        model,
        training,
        validation=validation,
        settings=replace(SHORT, schedule="step"),
        on_event=steps.append,
        seconds=1e-9,
    )
    assert [type(event) for event in steps] == [StepDone, EpochDone]
    assert not same(before, model.state_dict())


def test_events_tell_every_step_and_progress_only_grows(
    training: Frames, validation: Frames
) -> None:
    events: list[StepDone | EpochDone] = []
    model = new_network(SMALL, seed=0)
    fit(model, training, validation=validation, settings=SHORT, on_event=events.append)
    for epoch in (1, 2):
        steps = [e for e in events if isinstance(e, StepDone) and e.epoch == epoch]
        assert [step.step for step in steps] == list(range(1, steps[0].steps + 1))
        assert all(math.isfinite(step.loss_mm2) for step in steps)
    progress = [event.progress for event in events]
    assert progress == sorted(progress)
    assert progress[-1] == 1


def test_batch_normalisation_trains_too(training: Frames, validation: Frames) -> None:
    model = new_network(replace(SMALL, norm="batch"), seed=0)
    result = fit(model, training, validation=validation, settings=TrainingSettings(epochs=4))
    assert result.history[-1].loss_mm2 < result.history[0].loss_mm2


@given(epochs=st.integers(1, 400), epoch=st.integers(0, 400))
def test_steps_divide_the_rate_by_ten_every_fifty_epochs(epochs: int, epoch: int) -> None:
    settings = TrainingSettings(epochs=epochs, schedule="step")
    epoch = min(epoch, epochs - 1)
    rate = learning_rate_at(settings, epoch / epochs)
    assert rate == pytest.approx(1e-3 / 10 ** (epoch // 50))


@given(one=st.floats(0, 1), other=st.floats(0, 1))
def test_the_cosine_only_falls_from_the_first_rate_to_zero(one: float, other: float) -> None:
    settings = TrainingSettings(schedule="cosine", learning_rate=0.5)
    early, late = sorted((one, other))
    assert learning_rate_at(settings, early) >= learning_rate_at(settings, late)
    assert learning_rate_at(settings, 0.0) == 0.5
    assert learning_rate_at(settings, 1.0) == 0


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        ({"epochs": 0}, "number of epochs is 0, must be at least 1"),
        ({"groups": 0}, "number of groups in a batch is 0, must be at least 1"),
        ({"frames": 1}, "number of frames in a group is 1, must be at least 2"),
    ],
)
def test_counts_that_make_no_sense_are_refused(settings: dict[str, int], complaint: str) -> None:
    with pytest.raises(TooFew, match=complaint):
        replace(SHORT, **settings)  # type: ignore[arg-type]


def test_a_trained_network_predicts_what_it_was_scored_on(
    training: Frames, validation: Frames
) -> None:
    result = train(training, validation)
    model = DeformerNet(SMALL)
    model.load_state_dict(result.best)
    assert all(torch.isfinite(weights).all() for weights in model.state_dict().values())
