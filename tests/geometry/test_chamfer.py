"""The Chamfer distance is symmetric, zero for a cloud and itself, and in metres."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnet.geometry.chamfer import chamfer, nearest_distances
from dnet.types import Cloud

seeds = st.integers(0, 99)


def random_cloud(seed: int, count: int) -> Cloud:
    return np.random.default_rng(seed).normal(size=(count, 3)).astype(np.float32)


@given(seed=seeds, count=st.integers(1, 30), other=st.integers(1, 30))
def test_it_is_the_plain_definition(seed: int, count: int, other: int) -> None:
    one, two = random_cloud(seed, count), random_cloud(seed + 100, other)
    distance = np.linalg.norm(one[:, None].astype(float) - two[None].astype(float), axis=2)
    expected = (distance.min(axis=1).mean() + distance.min(axis=0).mean()) / 2
    assert chamfer(one, two) == pytest.approx(expected)
    assert chamfer(two, one) == pytest.approx(expected)


@given(seed=seeds)
def test_the_order_of_points_does_not_matter(seed: int) -> None:
    one, two = random_cloud(seed, 20), random_cloud(seed + 1, 20)
    shuffled = np.random.default_rng(seed).permutation(one)
    assert chamfer(shuffled, two) == pytest.approx(chamfer(one, two))


def test_a_cloud_is_where_it_is() -> None:
    assert chamfer(random_cloud(0, 50), random_cloud(0, 50)) == 0


def test_two_single_points_are_their_distance_apart() -> None:
    one = np.array([[0, 0, 0]], np.float32)
    two = np.array([[0.03, 0.04, 0]], np.float32)
    assert chamfer(one, two) == pytest.approx(0.05)
    np.testing.assert_allclose(nearest_distances(one, two), [0.05], rtol=1e-6)


def test_each_direction_counts_half() -> None:
    one = np.array([[0, 0, 0]], np.float32)
    two = np.array([[0, 0, 0], [0.3, 0, 0]], np.float32)
    # From one to two nothing, back a mean of 0.15.
    assert chamfer(one, two) == pytest.approx(0.075)
    assert chamfer(two, one) == pytest.approx(0.075)
