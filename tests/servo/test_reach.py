import numpy as np

from dnet.geometry.camera import Camera
from dnet.servo.reach import reachable, reachable_hidden_sides
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


def test_of_the_hidden_sides_those_towards_the_moving_arm_are_reachable() -> None:
    top, front = grid(2, 0.04), grid(1, -0.05)
    front[:, 2] = np.clip(front[:, 2], 0.0, 0.04)
    found = reachable_hidden_sides(np.concatenate([top, front]), Workspace())
    assert len(found) > 20
    # The moving arm comes from +x.
    assert (found[:, 0] > 0.045).all()


def test_a_side_that_is_seen_is_not_hidden() -> None:
    top, side = grid(2, 0.04), grid(0, 0.05)
    side[:, 2] = np.clip(side[:, 2], 0.0, 0.04)
    assert not len(reachable_hidden_sides(np.concatenate([top, side]), Workspace()))
