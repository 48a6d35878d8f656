import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from dnet.nets.deformernet import DeformerNet
from dnet.training.frames import Frames, Rows
from dnet.training.scores import errors_of, no_motion, score
from dnet.training.tasks import new_network
from tests.training.deforming_box import SMALL, BoxEpisode, box_frames


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Frames:
    return box_frames(tmp_path_factory.mktemp("boxes"), [0, 1])


@pytest.fixture(scope="module")
def model() -> DeformerNet:
    return new_network(SMALL, seed=0)


def test_scores_of_a_worked_example() -> None:
    true = torch.tensor([[0.003, 0.0, 0.0], [0.0, -0.004, 0.0]])
    predicted = torch.tensor([[0.003, 0.004, 0.003], [0.0, -0.004, 0.012]])
    scores = score(predicted, true)
    assert scores.pairs == 2
    assert scores.mse_mm2 == pytest.approx((16 + 9 + 144) / 6)
    assert scores.sum_mm2 == pytest.approx((16 + 9 + 144) / 2)
    assert scores.mean_mse_mm2 == pytest.approx(12.5 / 6)
    assert scores.mean_mm == pytest.approx((5 + 12) / 2)
    assert scores.zero_mse_mm2 == pytest.approx((9 + 16) / 6)
    assert scores.zero_mean_mm == pytest.approx((3 + 4) / 2)
    # About their mean (1.5, -2, 0) mm the motions vary by 2 (1.5^2 + 2^2) mm^2.
    assert scores.r2 == pytest.approx(1 - (16 + 9 + 144) / 12.5)


@given(seed=st.integers(0, 2**32 - 1), count=st.integers(2, 30))
def test_truth_scores_perfectly_and_the_mean_explains_nothing(seed: int, count: int) -> None:
    true = torch.from_numpy(np.random.default_rng(seed).normal(size=(count, 3)))
    perfect = score(true, true)
    assert (perfect.mse_mm2, perfect.mean_mm, perfect.r2) == (0, 0, 1)
    mean = score(true.mean(dim=0).expand_as(true), true)
    assert mean.r2 == pytest.approx(0, abs=1e-9)
    nothing = score(torch.zeros_like(true), true)
    assert nothing.mse_mm2 == nothing.zero_mse_mm2
    assert nothing.mean_mm == nothing.zero_mean_mm


def test_motions_that_do_not_vary_have_no_share_to_explain() -> None:
    still = torch.zeros(4, 3)
    assert score(still, still).r2 is None


def test_errors_are_those_of_predicting_every_pair(model: DeformerNet, frames: Frames) -> None:
    errors = errors_of(model, frames)
    squares, from_rest = [], []
    for seed in (0, 1):
        box = BoxEpisode(seed)
        shapes = [box.frame(index) for index in range(len(box.kinds))]
        for current in shapes:
            for goal in shapes:
                if current is not goal:
                    predicted = model.predict(current.cloud, goal.cloud)
                    error = np.square(1000 * (predicted - goal.grasp + current.grasp)).mean()
                    squares.append(error)
                    if current.kind == "rest":
                        from_rest.append(error)
    assert errors is not None
    assert errors.main.pairs == len(squares) == 60
    assert errors.main.mse_mm2 == pytest.approx(np.mean(squares), rel=1e-4)
    assert errors.from_rest is not None
    assert errors.from_rest.pairs == len(from_rest) == 10
    assert errors.from_rest.mse_mm2 == pytest.approx(np.mean(from_rest), rel=1e-4)


@pytest.mark.parametrize("training", [True, False])
def test_scoring_leaves_the_network_as_it_was(frames: Frames, training: bool) -> None:
    model = new_network(SMALL, seed=0).train(training)
    before = {name: weights.clone() for name, weights in model.state_dict().items()}
    errors_of(model, frames)
    assert model.training is training
    assert all(torch.equal(before[name], now) for name, now in model.state_dict().items())
    assert all(weights.grad is None for weights in model.parameters())


def test_frames_without_a_rest_shape_have_no_score_from_rest(
    model: DeformerNet, frames: Frames
) -> None:
    table = frames.table.where(~frames.table.rest)
    errors = errors_of(model, Frames.of(table, SMALL))
    assert errors is not None
    assert errors.main.pairs == 40
    assert errors.from_rest is None


def test_frames_without_a_pair_have_no_errors(model: DeformerNet, frames: Frames) -> None:
    table = frames.table.where(frames.table.rest)
    assert errors_of(model, Frames.of(table, SMALL)) is None


def test_whoever_watches_is_told_of_every_pair(model: DeformerNet, frames: Frames) -> None:
    told: list[tuple[int, int]] = []
    squares: list[float] = []

    def watch(current: Rows, goal: Rows, predicted: Tensor, true: Tensor) -> None:
        told.extend(zip(current.tolist(), goal.tolist(), strict=True))
        squares.extend(((1000 * (predicted - true)).square().mean(dim=1)).tolist())
        np.testing.assert_array_equal(true, frames.motions(current, goal))

    errors = errors_of(model, frames, watch=watch)
    assert errors is not None
    assert len(told) == len(set(told)) == 60
    assert np.mean(squares) == pytest.approx(errors.main.mse_mm2)


def test_no_motion_is_scored_on_every_pair(model: DeformerNet, frames: Frames) -> None:
    errors, nothing = errors_of(model, frames), no_motion(frames)
    assert errors is not None
    assert nothing.pairs == 60
    assert nothing.mse_mm2 == pytest.approx(errors.main.zero_mse_mm2)
