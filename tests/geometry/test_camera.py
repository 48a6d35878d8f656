"""Pixels and points are two views of one thing."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnet.geometry.camera import Camera, DepthImage, unproject
from dnet.geometry.pose import inverse, look_at, pose, quaternion, rotation_x, rotation_z

CAMERA = Camera(width=32, height=24)


@given(u=st.integers(0, 31), v=st.integers(0, 23), depth=st.floats(0.2, 1.5))
def test_a_point_projects_to_the_pixel_it_came_from(u: int, v: int, depth: float) -> None:
    image = DepthImage(np.full((24, 32), depth, np.float32), np.zeros((24, 32), np.int32), CAMERA)
    chosen = np.zeros((24, 32), bool)
    chosen[v, u] = True
    point = unproject(image, chosen)[0].astype(float)
    local = inverse(CAMERA.pose) @ np.array([*point, 1.0])
    assert local[2] == pytest.approx(depth, rel=1e-5)
    pixel = CAMERA.intrinsics @ local[:3] / local[2]
    np.testing.assert_allclose(pixel[:2], [u, v], atol=1e-3)


def test_points_come_row_by_row() -> None:
    image = DepthImage(np.ones((24, 32), np.float32), np.zeros((24, 32), np.int32), CAMERA)
    chosen = np.zeros((24, 32), bool)
    chosen[3, 20] = chosen[10, 5] = True
    cloud = unproject(image, chosen)
    only = np.zeros_like(chosen)
    only[3, 20] = True
    np.testing.assert_array_equal(cloud[0], unproject(image, only)[0])
    assert len(cloud) == 2


def test_the_camera_looks_at_its_target_upright() -> None:
    eye, target = np.array([0.3, -0.4, 0.5]), np.array([0.0, 0.1, 0.0])
    matrix = look_at(eye, target)
    np.testing.assert_allclose(matrix[:3, :3].T @ matrix[:3, :3], np.eye(3), atol=1e-12)
    assert np.linalg.det(matrix[:3, :3]) == pytest.approx(1)
    np.testing.assert_allclose(
        matrix[:3, 2], (target - eye) / np.linalg.norm(target - eye), atol=1e-12
    )
    assert matrix[2, 0] == pytest.approx(0)
    assert matrix[2, 1] < 0


def test_a_camera_that_looks_straight_down_is_refused() -> None:
    with pytest.raises(ValueError, match="no upright"):
        look_at(np.array([0.0, 0.0, 1.0]), np.zeros(3))


@given(yaw=st.floats(-3, 3), roll=st.floats(-3, 3))
def test_an_inverse_undoes_its_pose(yaw: float, roll: float) -> None:
    matrix = pose(rotation_z(yaw) @ rotation_x(roll), np.array([0.1, 0.2, 0.3]))
    np.testing.assert_allclose(inverse(matrix) @ matrix, np.eye(4), atol=1e-12)
    assert np.linalg.norm(quaternion(matrix[:3, :3])) == pytest.approx(1)
    assert quaternion(matrix[:3, :3])[3] >= 0
