import numpy as np

from dnet.geometry.camera import Camera
from dnet.servo.reach import reachable
from dnet.sim.scenes import Workspace
from dnet.types import Cloud

EYE = np.array(Camera().eye)


def grid(axis: int, value: float) -> Cloud:
    """A square of 0.1 m across one axis."""
    steps = np.linspace(-0.05, 0.05, 31)
    points = np.insert(np.array([(a, b) for a in steps for b in steps]), axis, value, axis=1)
    return points.astype(np.float32)


def test_the_top_is_reachable_but_for_the_room_of_the_holding_arm() -> None:
    top = grid(2, 0.04)
    found = reachable(top, Workspace())
    np.testing.assert_array_equal(found, top[:, 0] >= top[:, 0].min() + 0.05)


def test_the_front_is_not_reachable() -> None:
    assert not reachable(grid(1, -0.05), Workspace(clearance=0.0)).any()
