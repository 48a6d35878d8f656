import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dnet.geometry.camera import Camera
from dnet.geometry.extended_fpfh import BINS, FEATURES, extended_fpfh
from dnet.geometry.normals import normals
from dnet.types import Cloud

EYE = np.array(Camera().eye)


def bump(seed: int = 0, height: float = 0.03) -> Cloud:
    """A hill on a square of 0.1 m, steeper on one side."""
    x, y = np.random.default_rng(seed).uniform(-0.05, 0.05, (2, 1500))
    z = height * np.exp(-((x - 0.01) ** 2 + 2 * (y + 0.01) ** 2) / 0.03**2)
    return np.column_stack([x, y, z]).astype(np.float32)


def split(features: np.ndarray) -> tuple[np.ndarray, ...]:
    return tuple(features.reshape(3, BINS))


def test_three_histograms_of_45_bins_each_add_up_to_one() -> None:
    features = extended_fpfh(bump(), EYE)
    assert features.shape == (FEATURES,) == (135,)
    np.testing.assert_allclose(features.reshape(3, BINS).sum(axis=1), 1, atol=1e-6)
    assert (features >= 0).all()


def test_on_a_plane_every_normal_is_the_centroids() -> None:
    flat = bump(height=0.0)
    middle = BINS // 2
    for histogram in split(extended_fpfh(flat, EYE)):
        # v.n = 0, u.d = 0, atan2(0, 1) = 0: all in the middle bin.
        assert histogram[middle] == pytest.approx(1)


def test_the_angles_are_those_of_the_2010_paper() -> None:
    cloud = bump()
    points, own = cloud.astype(np.float64), normals(cloud, EYE)
    centre, u = points.mean(axis=0), own.mean(axis=0)
    u /= np.linalg.norm(u)
    counts = np.zeros((3, BINS))
    for point, normal in zip(points, own, strict=True):
        d = (point - centre) / np.linalg.norm(point - centre)
        v = np.cross(d, u) / np.linalg.norm(np.cross(d, u))
        w = np.cross(u, v)
        values = v @ normal, u @ d, np.arctan2(w @ normal, u @ normal) / np.pi
        for angle, value in enumerate(values):
            counts[angle, min(int(BINS * (value + 1) / 2), BINS - 1)] += 1
    np.testing.assert_allclose(extended_fpfh(cloud, EYE), counts.ravel() / 1500, atol=2 / 1500)


def test_a_turn_a_shift_and_another_scale_change_nothing() -> None:
    cloud, turn = bump(), Rotation.from_rotvec([0.3, -0.2, 1.1])
    shift = np.array([0.02, -0.01, 0.05])
    moved = (2 * turn.apply(cloud) + shift).astype(np.float32)
    with_camera = extended_fpfh(moved, 2 * turn.apply(EYE) + shift)
    # Values at the edge of a bin may fall on its other side.
    assert np.abs(with_camera - extended_fpfh(cloud, EYE)).sum() < 0.03


def test_two_samplings_are_nearer_than_two_shapes() -> None:
    one, again, other = (
        extended_fpfh(cloud, EYE) for cloud in (bump(0), bump(1), bump(0, height=0.01))
    )
    assert np.abs(one - again).sum() < np.abs(one - other).sum() / 2


def test_the_same_cloud_has_the_same_bytes() -> None:
    assert extended_fpfh(bump(), EYE).tobytes() == extended_fpfh(bump(), EYE).tobytes()
