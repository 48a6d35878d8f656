"""A plan goes as far as the object bears, and says so where that is not all the way."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnet.servo.sparing import LEAST_MOTION, SparingPlanner
from dnet.types import Joints, Plan, PlanStatus, Point
from tests.servo.slab import Slab

MOTION = np.array([0.03, 0.0, 0.04])
STAND = (np.zeros(6), np.arange(6.0))


@dataclass
class Tether:
    """Bears motions up to a length."""

    length: float
    asked: list[Point] = field(default_factory=list)

    def borne(self, motion: Point) -> float:
        self.asked.append(motion)
        return min(1.0, self.length / float(np.linalg.norm(motion)))


def plan(tether: Tether, slab: Slab | None = None) -> Plan:
    sparing = SparingPlanner(slab or Slab(), tether.borne)
    return sparing.plan(STAND, MOTION, seed=5)


def test_a_plan_that_the_object_bears_is_as_it_was() -> None:
    found, plain = plan(Tether(0.06)), Slab().plan(STAND, MOTION, seed=5)
    assert (found.status, found.reason, found.checks) == ("straight", "", plain.checks)
    np.testing.assert_array_equal(found.path, plain.path)
    np.testing.assert_array_equal(found.times, plain.times)


@given(length=st.floats(LEAST_MOTION * 1.001, 0.0499))
def test_a_motion_is_cut_to_what_the_object_bears_and_never_called_whole(length: float) -> None:
    found = plan(Tether(length))
    assert found.status == "partial"
    np.testing.assert_allclose(found.achieved, MOTION * length / 0.05, rtol=1e-12)
    np.testing.assert_array_equal(found.requested, MOTION)
    np.testing.assert_allclose(found.path[-1, :3] - found.path[0, :3], found.achieved, atol=1e-12)
    assert f"beyond {length * 1e3:.1f} of 50.0 mm" in found.reason


@given(length=st.floats(0.0, LEAST_MOTION * 0.999))
def test_where_hardly_any_motion_is_borne_the_arm_stays(length: float) -> None:
    found = plan(Tether(length))
    assert found.status == "failed"
    assert "of 50.0 mm the object is crushed" in found.reason
    np.testing.assert_array_equal(found.path, STAND[1][None])
    np.testing.assert_array_equal(found.times, [0.0])
    np.testing.assert_array_equal(found.achieved, np.zeros(3))


def test_of_a_plan_that_fails_anyway_nothing_is_foreseen() -> None:
    tether = Tether(0.01)
    found = plan(tether, Slab(blocked=True))
    assert (found.status, found.reason) == ("failed", "a wall")
    assert tether.asked == []


def test_what_is_foreseen_is_the_plan_and_not_what_was_asked_for() -> None:
    class Short(Slab):
        def plan(
            self,
            joints: tuple[Joints, Joints],
            displacement: Point,
            *,
            seed: int,
            waypoints: int = 0,
        ) -> Plan:
            half = super().plan(joints, displacement / 2, seed=seed)
            return replace(half, status="partial", requested=displacement, reason="a wall")

    tether = Tether(0.03)
    found = plan(tether, Short())
    assert (found.status, found.reason) == ("partial", "a wall")
    np.testing.assert_array_equal(tether.asked, [MOTION / 2])


@pytest.mark.parametrize("obstacle", ["failed", "partial"])
def test_why_the_shorter_motion_is_not_free_is_said_too(obstacle: PlanStatus) -> None:
    class Walled(Slab):
        def plan(
            self,
            joints: tuple[Joints, Joints],
            displacement: Point,
            *,
            seed: int,
            waypoints: int = 0,
        ) -> Plan:
            found = super().plan(joints, displacement, seed=seed)
            if float(np.linalg.norm(displacement)) < 0.04:
                return replace(found, status=obstacle, reason="a wall")
            return found

    found = plan(Tether(0.03), Walled())
    assert found.status == obstacle
    assert found.reason == "beyond 30.0 of 50.0 mm the object is crushed; a wall"
