"""Noise is that of the published camera, and none where it is turned off."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnet.errors import NotAFraction
from dnet.geometry.camera import Camera, DepthImage
from dnet.perception.noise import DepthNoise, near_edges

CAMERA = Camera(width=160, height=120)
BLOCK = (slice(40, 80), slice(50, 110))
ONLY_WAVERS = DepthNoise(lateral=0.0, dropout=0.0)


def wall(distance: float) -> DepthImage:
    """A flat body that fills the view."""
    depth = np.full((120, 160), distance, np.float32)
    return DepthImage(depth, np.zeros((120, 160), np.int32), CAMERA)


def block() -> DepthImage:
    """A block in front of a table, in front of nothing."""
    image = wall(0.5)
    image.mask[:] = 1
    image.depth[BLOCK], image.mask[BLOCK] = 0.45, 0
    image.depth[:, :10], image.mask[:, :10] = CAMERA.far, -1
    return image


def noisy(image: DepthImage, noise: DepthNoise, seed: int = 0) -> DepthImage:
    return noise.apply(image, random=np.random.default_rng(seed))


@given(seed=st.integers(0, 99), dropout=st.floats(0, 1), lateral=st.floats(0, 5))
def test_no_noise_changes_nothing(seed: int, dropout: float, lateral: float) -> None:
    image = block()
    same = noisy(image, DepthNoise(scale=0.0, lateral=lateral, dropout=dropout), seed)
    np.testing.assert_array_equal(same.depth, image.depth)
    np.testing.assert_array_equal(same.mask, image.mask)
    assert same.camera is image.camera


def test_the_same_seed_gives_the_same_image_and_leaves_the_first_alone() -> None:
    image = block()
    one, other, third = (noisy(image, DepthNoise(), seed) for seed in (4, 4, 5))
    assert one.depth.tobytes() == other.depth.tobytes()
    assert one.mask.tobytes() == other.mask.tobytes()
    assert one.depth.tobytes() != third.depth.tobytes()
    assert image.depth.tobytes() == block().depth.tobytes()
    assert image.mask.tobytes() == block().mask.tobytes()


@pytest.mark.parametrize(
    ("distance", "published"), [(0.4, 1.2e-3), (0.5, 1.219e-3), (1.4, 3.1e-3), (1.9, 5.475e-3)]
)
@pytest.mark.parametrize("scale", [1.0, 0.25])
def test_depth_wavers_as_published_and_by_the_scale(
    distance: float, published: float, scale: float
) -> None:
    seen = noisy(wall(distance), DepthNoise(scale=scale, lateral=0.0, dropout=0.0))
    error = seen.depth - np.float32(distance)
    count = error.size
    assert error.std() == pytest.approx(scale * published, rel=4 / np.sqrt(2 * count))
    assert abs(error.mean()) < 4 * scale * published / np.sqrt(count)


def test_where_nothing_is_nothing_wavers() -> None:
    image = block()
    nothing = image.mask == -1
    seen = noisy(image, ONLY_WAVERS)
    np.testing.assert_array_equal(seen.depth[nothing], image.depth[nothing])
    np.testing.assert_array_equal(seen.mask, image.mask)
    assert (seen.depth[~nothing] != image.depth[~nothing]).mean() > 0.99


def test_edges_fray_and_surfaces_stay_whole() -> None:
    image = block()
    seen = noisy(image, DepthNoise(lateral=1.0, dropout=0.0))
    moved = seen.mask != image.mask
    assert 0.1 < moved[near_edges(image.depth)].mean() < 0.6
    assert not moved[~near_edges(image.depth)].any()
    # A pixel that looks elsewhere brings owner and depth from there.
    for owner, distance in ((0, 0.45), (1, 0.5)):
        np.testing.assert_allclose(seen.depth[seen.mask == owner], distance, atol=0.01)


def test_the_share_of_pixels_lost_at_edges_is_the_one_asked_for() -> None:
    image = block()
    near = near_edges(image.depth)
    seen = noisy(image, DepthNoise(lateral=0.0, dropout=0.3))
    lost = (seen.mask == -1) & (image.mask != -1)
    assert not lost[~near].any()
    candidates = near & (image.mask != -1)
    share = lost[candidates].mean()
    assert share == pytest.approx(0.3, abs=4 * np.sqrt(0.3 * 0.7 / candidates.sum()))
    assert set(seen.depth[lost].tolist()) == {CAMERA.far}


def test_pixels_near_an_edge_are_two_deep_on_both_sides() -> None:
    depth = np.full((9, 9), 0.5, np.float32)
    depth[:, 5:] = 0.6
    near = near_edges(depth)
    assert near.any(axis=0).tolist() == near.all(axis=0).tolist()
    assert np.flatnonzero(near[0]).tolist() == [3, 4, 5, 6]
    np.testing.assert_array_equal(near_edges(depth.T), near.T)


@given(slope=st.floats(-0.009, 0.009))
def test_a_slope_has_no_edges(slope: float) -> None:
    depth = (1.0 + slope * np.arange(20)).astype(np.float32)
    assert not near_edges(np.tile(depth, (5, 1))).any()


@pytest.mark.parametrize("dropout", [-0.1, 1.5, np.nan])
def test_a_dropout_that_is_no_share_is_refused(dropout: float) -> None:
    with pytest.raises(NotAFraction, match="dropout"):
        DepthNoise(dropout=dropout)
