"""Rigid transforms as 4x4 matrices: rotation above, translation in the last column."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from dnet.types import Point, Pose, Transform

Rotation3 = Float64[np.ndarray, "3 3"]


def rotation_x(angle: float) -> Rotation3:
    """Return the rotation by `angle` about x."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def rotation_z(angle: float) -> Rotation3:
    """Return the rotation by `angle` about z."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def rotations_z(angles: Float64[np.ndarray, "n"]) -> Float64[np.ndarray, "n 3 3"]:
    """Return the rotations by `angles` about z."""
    turns = np.zeros((len(angles), 3, 3))
    turns[:, 0, 0] = turns[:, 1, 1] = np.cos(angles)
    turns[:, 1, 0] = np.sin(angles)
    turns[:, 0, 1] = -turns[:, 1, 0]
    turns[:, 2, 2] = 1.0
    return turns


def about_z(
    frames: Float64[np.ndarray, "... 4 4"],
    *,
    angles: Float64[np.ndarray, "..."],
    distances: Float64[np.ndarray, "..."],
) -> Float64[np.ndarray, "... 4 4"]:
    """Return frames turned about their own z by `angles` and slid along it by `distances`.

    Frames, angles and distances are repeated against each other as numpy does it.
    """
    c, s = np.cos(angles)[..., None], np.sin(angles)[..., None]
    shape = np.broadcast_shapes(frames.shape[:-2], angles.shape, distances.shape)
    result = np.empty((*shape, 4, 4))
    result[...] = frames
    result[..., 0] = frames[..., 0] * c + frames[..., 1] * s
    result[..., 1] = frames[..., 1] * c - frames[..., 0] * s
    result[..., :3, 3] += frames[..., :3, 2] * distances[..., None]
    return result


def pose(rotation: Rotation3, translation: Point) -> Pose:
    """Return the 4x4 matrix of a rotation followed by a translation."""
    matrix = np.eye(4)
    matrix[:3, :3] = rotation
    matrix[:3, 3] = translation
    return matrix


def inverse(matrix: Pose) -> Pose:
    """Return the inverse of a rigid transform, exact to rounding."""
    rotation = matrix[:3, :3].T
    return pose(rotation, -rotation @ matrix[:3, 3])


def quaternion(rotation: Rotation3) -> Float64[np.ndarray, "4"]:
    """Return the unit quaternion x y z w of a rotation, with w >= 0."""
    return quaternions(rotation[None])[0]


def quaternions(rotations: Float64[np.ndarray, "n 3 3"]) -> Float64[np.ndarray, "n 4"]:
    """Return the unit quaternions x y z w of rotations, with w >= 0."""
    return np.asarray(Rotation.from_matrix(rotations).as_quat(canonical=True), dtype=np.float64)


def transform(parent: str, child: str, matrix: Pose) -> Transform:
    """Return the named transform of `child` in `parent`."""
    return transforms([(parent, child)], matrix[None])[0]


def transforms(
    names: Sequence[tuple[str, str]], matrices: Float64[np.ndarray, "n 4 4"]
) -> list[Transform]:
    """Return named transforms, each of a child in its parent.

    Many together cost hardly more than one: scipy checks what it is given once.
    """
    turns = quaternions(matrices[:, :3, :3])
    return [
        Transform(parent, child, matrix[:3, 3].copy(), turn)
        for (parent, child), matrix, turn in zip(names, matrices, turns, strict=True)
    ]


def look_at(eye: Point, target: Point) -> Pose:
    """Return the pose of a camera at `eye` that looks at `target`, upright.

    The optical convention: x right, y down, z forward.

    Raises:
        ValueError: If the camera would look straight up or down.
    """
    forward = target - eye
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    length = float(np.linalg.norm(right))
    if length < 1e-9:
        raise ValueError(f"a camera at {eye} that looks at {target} has no upright; move it aside")
    right /= length
    return pose(np.column_stack([right, np.cross(forward, right), forward]), eye)
