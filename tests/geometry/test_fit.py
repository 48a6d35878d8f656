import numpy as np
import pytest

from dnet.geometry.chamfer import chamfer
from dnet.geometry.fit import fit
from dnet.types import Cloud


def flat() -> Cloud:
    return np.append(
        np.random.default_rng(0).uniform(-0.05, 0.05, (800, 2)), np.zeros((800, 1)), axis=1
    ).astype(np.float32)


def bent(points: Cloud, height: float) -> Cloud:
    lift = height * np.exp(-np.square(points[:, :2] / 0.03).sum(axis=1))
    return (points + lift[:, None] * np.array([0, 0, 1])).astype(np.float32)


def test_what_lies_on_the_goal_stays() -> None:
    cloud = flat()
    np.testing.assert_array_equal(
        fit(cloud, bent(cloud, 0.03), bent(cloud, 0.03)), bent(cloud, 0.03)
    )


@pytest.mark.parametrize("seed", [0, 1])
def test_what_falls_short_of_the_goal_comes_to_lie_on_it_point_by_point(seed: int) -> None:
    cloud = flat()
    goal = np.random.default_rng(seed).permutation(bent(cloud, 0.03))
    short, true = bent(cloud, 0.02), bent(cloud, 0.03)
    found = fit(cloud, short, goal)
    assert chamfer(found, goal) < 0.4 * chamfer(short, goal)
    assert np.linalg.norm(found - true, axis=1).mean() < np.linalg.norm(short - true, axis=1).mean()


def test_what_is_shifted_as_a_whole_is_shifted_all_the_way() -> None:
    cloud = flat()
    goal = cloud + np.array([0, 0, 0.001], np.float32)
    # Each point is pulled twice, by its own nearest and as the nearest of one: their mean counts.
    np.testing.assert_allclose(fit(cloud, cloud, goal), goal, atol=1e-7)


def test_the_order_of_the_goal_does_not_matter() -> None:
    cloud = flat()
    goal = bent(cloud, 0.03)
    other = np.random.default_rng(0).permutation(goal)
    np.testing.assert_allclose(
        fit(cloud, bent(cloud, 0.02), other), fit(cloud, bent(cloud, 0.02), goal), atol=1e-7
    )
