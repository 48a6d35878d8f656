import numpy as np

from dnet.geometry.camera import Camera
from dnet.geometry.normals import normals
from dnet.types import Cloud

EYE = np.array(Camera().eye)


def grid(axis: int, value: float) -> Cloud:
    """A square of 0.1 m across one axis."""
    steps = np.linspace(-0.05, 0.05, 31)
    points = np.insert(np.array([(a, b) for a in steps for b in steps]), axis, value, axis=1)
    return points.astype(np.float32)


def test_normals_point_out_of_what_is_seen() -> None:
    np.testing.assert_allclose(normals(grid(2, 0.04), EYE), [[0, 0, 1]] * 961, atol=1e-6)
    np.testing.assert_allclose(normals(grid(1, -0.05), EYE), [[0, -1, 0]] * 961, atol=1e-6)
