import numpy as np
import pytest

from dnet.evaluation.registration import coherent, rigid, unmoved
from dnet.geometry.chamfer import chamfer
from dnet.geometry.pose import rotation_z
from dnet.nets.keypoints import Keypoints
from dnet.types import Cloud


def box(points: int = 600) -> Cloud:
    return (
        np.random.default_rng(0)
        .uniform([-0.05, -0.04, 0], [0.05, 0.04, 0.03], (points, 3))
        .astype(np.float32)
    )


def turned(cloud: Cloud) -> Cloud:
    return (cloud @ rotation_z(0.05).T + [0.002, 0.0, 0.001]).astype(np.float32)


def test_rigid_registration_finds_a_rigid_motion() -> None:
    found = rigid(box(), np.random.default_rng(1).permutation(turned(box())))
    np.testing.assert_allclose(found.goal, turned(found.initial), atol=1e-6)
    assert found.residual < 1e-5


def test_unmoved_keypoints_leave_all_of_the_difference() -> None:
    found = unmoved(box(), turned(box()))
    np.testing.assert_array_equal(found.goal, found.initial)
    assert found.residual == chamfer(box(), turned(box()))
    assert found.initial.shape == (200, 3)


def test_coherent_point_drift_follows_a_bend() -> None:
    pytest.importorskip("pycpd")
    rng = np.random.default_rng(0)
    flat = np.column_stack([rng.uniform(-0.05, 0.05, (700, 2)), np.zeros(700)]).astype(np.float32)

    def bent(points: Cloud) -> Cloud:
        return points + np.array([0, 0, 8], np.float32) * points[:, :1] ** 2

    def error_of(found: Keypoints) -> float:
        return float(np.linalg.norm(found.goal - bent(found.initial), axis=1).mean())

    goal = rng.permutation(bent(flat))
    assert error_of(coherent(flat, goal)) < 0.5 * error_of(unmoved(flat, goal))
