import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from torch import Tensor

from dnet.geometry.chamfer import chamfer
from dnet.training.keypoint_batch import near, reverse_of
from dnet.training.keypoint_loss import KeypointLossWeights, Nearest, keypoint_loss, stretch

PLAIN = KeypointLossWeights(isometry=0.5, back=0.25)


def points(seed: int, clouds: int = 2, count: int = 60) -> Tensor:
    return torch.rand(clouds, count, 3, generator=torch.Generator().manual_seed(seed))


@given(seed=st.integers(0, 99))
def test_a_rigid_motion_stretches_nothing(seed: int) -> None:
    turn = Rotation.random(random_state=seed).as_matrix().astype(np.float32)
    start = points(seed)
    moved = start @ torch.from_numpy(turn) + points(seed + 1, count=1)
    assert float(stretch(start, moved, near(start, 8)).max()) < 1e-9


@given(share=st.floats(0.5, 2.0))
def test_stretch_is_the_square_of_how_much_longer_edges_are(share: float) -> None:
    start = points(0)
    found = stretch(start, start * share, near(start, 5))
    assert found.tolist() == pytest.approx([(share - 1) ** 2] * 2, abs=1e-4)


def test_the_chamfer_term_is_the_chamfer_distance() -> None:
    one, other = points(0, 1), points(1, 1, 50)
    found = Nearest.between(one, other).chamfer(one, other)
    assert float(found) == pytest.approx(chamfer(one[0].numpy(), other[0].numpy()), abs=1e-4)


def test_carrying_points_exactly_there_and_back_costs_nothing() -> None:
    start = points(0)
    motion = torch.tensor([0.3, -0.1, 0.2]).expand_as(start)
    loss = keypoint_loss(
        start, motion, start + motion, reverse=-motion, neighbours=near(start, 8), weights=PLAIN
    )
    assert float(loss.total.max()) < 1e-6


def test_each_term_counts_by_its_weight() -> None:
    start, end = points(0), points(1, count=50)
    moves, reverse = 0.1 * points(2), 0.1 * points(3, count=50)
    loss = keypoint_loss(
        start, moves, end, reverse=reverse, neighbours=near(start, 8), weights=PLAIN
    )
    expected = loss.chamfer + 0.5 * loss.isometry + 0.25 * loss.back
    torch.testing.assert_close(loss.total, expected)
    assert all(bool((term > 0).all()) for term in (loss.chamfer, loss.isometry, loss.back))


def test_points_that_lie_on_their_goal_have_no_gradient() -> None:
    start = points(0)
    moves = torch.zeros_like(start, requires_grad=True)
    loss = keypoint_loss(
        start, moves, start, reverse=moves, neighbours=near(start, 8), weights=PLAIN
    )
    torch.autograd.backward(loss.total.mean())
    assert moves.grad is not None
    assert float(moves.grad.abs().max()) == 0.0


def test_the_order_of_points_does_not_change_the_loss() -> None:
    start, end = points(0), points(1)
    moves, reverse = 0.1 * points(2), 0.1 * points(3)
    order, other = torch.randperm(60), torch.randperm(60)
    plain = keypoint_loss(
        start, moves, end, reverse=reverse, neighbours=near(start, 8), weights=PLAIN
    )
    mixed = keypoint_loss(
        start[:, order],
        moves[:, order],
        end[:, other],
        reverse=reverse[:, other],
        neighbours=near(start[:, order], 8),
        weights=PLAIN,
    )
    torch.testing.assert_close(mixed.total, plain.total)


def test_every_pair_finds_the_one_that_goes_back() -> None:
    current = torch.tensor([0, 1, 2, 0, 1, 2])
    goal = torch.tensor([1, 0, 0, 2, 2, 1])
    back = reverse_of(current, goal, 3)
    assert torch.equal(current[back], goal)
    assert torch.equal(goal[back], current)


def test_near_points_are_the_nearest_but_not_the_point_itself() -> None:
    cloud = points(0, 1, 30)
    distances = torch.cdist(cloud, cloud)[0] + 9 * torch.eye(30)
    found = near(cloud, 4)[0]
    expected = distances.argsort(dim=1)[:, :4]
    assert torch.equal(found.sort(dim=1).values, expected.sort(dim=1).values)
