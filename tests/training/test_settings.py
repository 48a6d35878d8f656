from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnet.errors import TooFew
from dnet.training.settings import WARM_UP, TrainingSettings

LATE = 10 * WARM_UP


@given(epochs=st.integers(1, 400), epoch=st.integers(0, 400))
def test_steps_divide_the_rate_by_ten_every_fifty_epochs(epochs: int, epoch: int) -> None:
    settings = TrainingSettings(epochs=epochs, schedule="step", learning_rate=1e-3)
    epoch = min(epoch, epochs - 1)
    rate = settings.rate(epoch / epochs, step=LATE)
    assert rate == pytest.approx(1e-3 / 10 ** (epoch // 50))


@given(one=st.floats(0, 1), other=st.floats(0, 1))
def test_the_cosine_only_falls_from_the_first_rate_to_zero(one: float, other: float) -> None:
    settings = TrainingSettings(schedule="cosine", learning_rate=0.5)
    early, late = sorted((one, other))
    assert settings.rate(early, step=LATE) >= settings.rate(late, step=LATE)
    assert settings.rate(0.0, step=LATE) == 0.5
    assert settings.rate(1.0, step=LATE) == 0


@given(step=st.integers(0, 2 * WARM_UP))
def test_the_rate_comes_up_in_the_first_steps(step: int) -> None:
    settings = TrainingSettings(learning_rate=1.0)
    assert 0 < settings.rate(0.0, step=step) <= settings.rate(0.0, step=step + 1) <= 1
    assert settings.rate(0.0, step=WARM_UP) == 1


@given(step=st.integers(0, 10**6))
def test_averages_forget_the_first_weights_and_keep_more_as_time_goes_on(step: int) -> None:
    settings = TrainingSettings()
    assert settings.kept(step) <= settings.kept(step + 1) <= settings.average
    assert settings.kept(0) == pytest.approx(0.1)
    assert settings.kept(10**6) == settings.average


def test_a_batch_encodes_as_many_clouds_whatever_its_pairs() -> None:
    settings = TrainingSettings(groups=3, frames=10)
    assert settings.batch == 3
    assert replace(settings, pairs="any").batch == 15
    assert replace(settings, pairs="rest", groups=1, frames=2).batch == 1


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        ({"epochs": 0}, "number of epochs is 0, must be at least 1e-09"),
        ({"groups": 0}, "number of groups in a batch is 0, must be at least 1"),
        ({"frames": 1}, "number of frames in a group is 1, must be at least 2"),
    ],
)
def test_counts_that_make_no_sense_are_refused(settings: dict[str, int], complaint: str) -> None:
    with pytest.raises(TooFew, match=complaint):
        replace(TrainingSettings(), **settings)  # type: ignore[arg-type]
