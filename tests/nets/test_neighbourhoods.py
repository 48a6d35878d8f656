import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from dnet.geometry.sampling import farthest_points
from dnet.nets.neighbourhoods import (
    BANDWIDTHS,
    GROUPINGS,
    Grouping,
    Neighbourhoods,
    find_neighbourhoods,
    regroup,
    stack,
)
from dnet.types import Cloud

FEW = (Grouping(12, 5), Grouping(4, 6))


def cloud(seed: int, count: int = 40) -> Cloud:
    rng = np.random.default_rng(seed)
    return farthest_points(rng.normal(size=(count, 3)).astype(np.float32), count)


def squares(points: Cloud) -> np.ndarray:
    exact = points.astype(np.float64)
    return np.square(exact[:, None] - exact[None]).sum(-1)


def tables(found: Neighbourhoods) -> list[torch.Tensor]:
    return [found.points, found.centroids, *found.neighbours, *found.inverse_densities]


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None)
def test_each_centroid_gathers_its_nearest_points_and_itself(seed: int) -> None:
    points = cloud(seed)
    found = find_neighbourhoods(points, FEW)
    for table, below, grouping in zip(found.neighbours, (40, 12), FEW, strict=True):
        assert table.shape == (grouping.centroids, grouping.neighbours)
        distances = squares(points[:below])
        for centroid, rows in enumerate(table.long().numpy()):
            assert centroid in rows
            assert len(set(rows)) == grouping.neighbours
            left_out = np.setdiff1d(np.arange(below), rows)
            assert distances[centroid][rows].max() <= distances[centroid][left_out].min()


# Rows are summed in blocks of 128: the larger cloud has several, the last not full.
@given(
    seed=st.integers(0, 2**32 - 1),
    far=st.sampled_from([0.0, 2.0, 64.0]),
    size=st.sampled_from([40, 300]),
)
@settings(max_examples=30, deadline=None)
def test_densities_are_those_of_double_precision_wherever_the_cloud_stands(
    seed: int, far: float, size: int
) -> None:
    points = (cloud(seed, size) * 0.3 + far).astype(np.float32)
    found = find_neighbourhoods(points, FEW)
    counts = (size, 12, 4)
    for got, bandwidth, count in zip(found.inverse_densities, BANDWIDTHS, counts, strict=True):
        kernel = np.exp(-squares(points[:count]) / (2 * bandwidth**2)) / (2.5 * bandwidth)
        np.testing.assert_allclose(got.numpy(), 1 / kernel.mean(axis=1), rtol=1e-5)


def test_a_lonely_point_has_a_larger_inverse_density_than_a_crowded_one() -> None:
    crowd = np.random.default_rng(0).normal(scale=0.01, size=(39, 3))
    points = np.vstack([[1.0, 1.0, 1.0], crowd]).astype(np.float32)
    density = find_neighbourhoods(points, FEW).inverse_densities[0]
    assert density[0] > 10 * density[1:].max()


def test_each_point_of_a_crowd_counts_all_others() -> None:
    crowd = np.random.default_rng(0).normal(scale=1e-6, size=(300, 3)).astype(np.float32)
    found = find_neighbourhoods(crowd, FEW).inverse_densities[0].numpy()
    np.testing.assert_allclose(found, 2.5 * BANDWIDTHS[0], rtol=1e-6)


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_the_centroids_of_a_cloud_in_farthest_point_order_are_its_first_points(seed: int) -> None:
    found = find_neighbourhoods(cloud(seed), FEW)
    assert found.centroids.tolist() == list(range(12))


@given(seed=st.integers(0, 2**32 - 1), start=st.integers(0, 39))
@settings(max_examples=20, deadline=None)
def test_other_centroids_make_the_tables_of_the_cloud_sampled_from_there(
    seed: int, start: int
) -> None:
    points = cloud(seed)
    again = regroup(find_neighbourhoods(points, FEW), FEW, start=start)
    for got, want in zip(
        tables(again), tables(find_neighbourhoods(points, FEW, start=start)), strict=True
    ):
        assert torch.equal(got, want)
    assert again.centroids[0] == start
    sampled = farthest_points(points, 12, start=start)
    np.testing.assert_array_equal(points[again.centroids.long()], sampled)


def test_other_centroids_share_the_memory_of_points_and_density() -> None:
    found = find_neighbourhoods(cloud(0), FEW)
    again = regroup(found, FEW, start=9)
    assert again.points.data_ptr() == found.points.data_ptr()
    assert again.inverse_densities[0].data_ptr() == found.inverse_densities[0].data_ptr()


def test_a_batch_holds_each_cloud_as_it_was() -> None:
    singles = [find_neighbourhoods(cloud(seed), FEW) for seed in range(4)]
    batch = stack(singles)
    for place, single in enumerate(singles):
        for many, one in zip(tables(batch), tables(single), strict=True):
            assert len(many) == 4
            assert torch.equal(many[place], one)


def test_moving_to_a_device_keeps_the_tables() -> None:
    found = find_neighbourhoods(cloud(0), FEW)
    for before, after in zip(tables(found), tables(found.to(torch.device("cpu"))), strict=True):
        assert torch.equal(before, after)


def test_tables_do_not_change_with_the_array_that_they_came_from() -> None:
    points = cloud(0)
    found = find_neighbourhoods(points, FEW)
    before = found.points.clone()
    points[:] = 0
    assert torch.equal(found.points, before)


def test_coincident_points_have_finite_densities() -> None:
    points = np.zeros((40, 3), dtype=np.float32)
    for density, bandwidth in zip(
        find_neighbourhoods(points, FEW).inverse_densities, BANDWIDTHS, strict=True
    ):
        torch.testing.assert_close(density, torch.full_like(density, 2.5 * bandwidth))


@pytest.mark.parametrize("size", ["light", "paper"])
def test_thirty_thousand_clouds_take_at_most_three_gigabytes(size: str) -> None:
    points = np.random.default_rng(0).normal(size=(2048, 3)).astype(np.float32)
    found = find_neighbourhoods(points, GROUPINGS["light" if size == "light" else "paper"])
    nbytes = sum(table.nbytes for table in tables(found))
    assert 30_000 * nbytes < 3e9
