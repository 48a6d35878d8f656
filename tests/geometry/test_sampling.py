"""Farthest point sampling is greedy and exact, and its prefixes are samples too."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnet.errors import BadCloud, ShortCloud
from dnet.geometry.sampling import farthest_points
from dnet.types import Cloud


def random_cloud(seed: int, count: int) -> Cloud:
    return np.random.default_rng(seed).normal(size=(count, 3)).astype(np.float32)


@given(seed=st.integers(0, 99), count=st.integers(2, 40), start=st.integers(0, 39))
def test_each_point_is_the_farthest_from_those_before(seed: int, count: int, start: int) -> None:
    cloud = random_cloud(seed, 40)
    sampled = farthest_points(cloud, count, start=start)
    np.testing.assert_array_equal(sampled[0], cloud[start])
    for k in range(1, count):
        to_chosen = np.linalg.norm(cloud[:, None] - sampled[None, :k], axis=2).min(axis=1)
        reached = np.linalg.norm(sampled[k] - sampled[:k], axis=1).min()
        assert reached == pytest.approx(to_chosen.max(), rel=1e-5)


@given(seed=st.integers(0, 99), few=st.integers(1, 20), more=st.integers(20, 40))
def test_a_prefix_is_a_sample(seed: int, few: int, more: int) -> None:
    cloud = random_cloud(seed, 40)
    np.testing.assert_array_equal(farthest_points(cloud, more)[:few], farthest_points(cloud, few))


@given(seed=st.integers(0, 99))
def test_points_are_rows_of_the_cloud_and_none_comes_twice(seed: int) -> None:
    cloud = random_cloud(seed, 60)
    rows = {tuple(row) for row in cloud}
    sampled = [tuple(row) for row in farthest_points(cloud, 30)]
    assert set(sampled) <= rows
    assert len(set(sampled)) == 30


def test_too_few_points_are_refused_with_both_counts() -> None:
    with pytest.raises(ShortCloud, match="cloud has 5 points, need at least 6"):
        farthest_points(random_cloud(0, 5), 6)


def test_coordinates_that_are_no_numbers_are_refused() -> None:
    cloud = random_cloud(0, 10)
    cloud[3, 1] = np.nan
    with pytest.raises(BadCloud, match="1 of 10 points"):
        farthest_points(cloud, 4)
