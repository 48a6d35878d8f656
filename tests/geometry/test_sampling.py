"""Farthest point sampling is greedy and exact, and its prefixes are samples too."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnet.errors import BadCloud, ShortCloud
from dnet.geometry.sampling import farthest_points, farthest_rows
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


def greedy_rows(cloud: Cloud, count: int, start: int) -> list[int]:
    """Farthest point sampling as its definition says: look at every point, every time."""
    squared = np.full(len(cloud), np.inf, np.float32)
    rows = [start]
    while len(rows) < count:
        squared[rows[-1]] = -1.0
        x, y, z = ((cloud - cloud[rows[-1]]) ** 2).T
        squared = np.minimum(squared, x + y + z)
        rows.append(int(squared.argmax()))
    return rows


def any_cloud(kind: str, count: int, seed: int) -> Cloud:
    """Clouds with many equal distances, equal points, no depth, and far from the origin."""
    rng = np.random.default_rng(seed)
    spread = rng.normal(size=(count, 3))
    return {
        "spread": spread,
        "grid": rng.integers(0, 6, (count, 3)).astype(np.float64),
        "twice": np.resize(spread[: (count + 1) // 2], (count, 3)),
        "flat": spread * [1.0, 1.0, 0.0],
        "one spot": np.tile(spread[:1], (count, 1)),
        "small and far": 1e-4 * spread + 10.0,
        "large": 1e15 * spread,
    }[kind].astype(np.float32)


KINDS = ["spread", "grid", "twice", "flat", "one spot", "small and far", "large"]


@given(
    kind=st.sampled_from(KINDS),
    points=st.integers(1, 300),
    seed=st.integers(0, 99),
    draw=st.data(),
)
def test_the_rows_are_those_of_the_definition(
    kind: str, points: int, seed: int, draw: st.DataObject
) -> None:
    cloud = any_cloud(kind, points, seed)
    count = draw.draw(st.integers(1, points))
    start = draw.draw(st.integers(0, points - 1))
    rows = farthest_rows(cloud, count, start=start)
    assert rows.tolist() == greedy_rows(cloud, count, start)


def test_the_rows_of_a_whole_image_are_those_of_the_definition() -> None:
    rng = np.random.default_rng(0)
    x, y = np.meshgrid(np.linspace(-0.05, 0.05, 100), np.linspace(-0.04, 0.04, 80))
    z = 0.04 + 0.01 * np.sin(60 * x) + rng.normal(scale=1e-4, size=x.shape)
    cloud = np.stack([x, y, z], axis=-1).reshape(-1, 3).astype(np.float32)
    assert farthest_rows(cloud, 2048).tolist() == greedy_rows(cloud, 2048, 0)


@pytest.mark.parametrize("kind", KINDS)
def test_all_points_can_be_asked_for_and_none_comes_twice(kind: str) -> None:
    rows = farthest_rows(any_cloud(kind, 200, 0), 200, start=7)
    assert rows[0] == 7
    assert sorted(rows.tolist()) == list(range(200))


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
