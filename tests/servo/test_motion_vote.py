from dataclasses import dataclass

import numpy as np
import pytest

from dnet.errors import NoDisplacement, OutOfReach
from dnet.servo.motion_vote import MotionVote
from dnet.sim.scenes import Workspace
from dnet.types import Cloud, Point
from tests.servo.test_displacement_heuristic import CENTRE, bumped, slab


@dataclass(frozen=True)
class Asks:
    """A controller that asks for one motion."""

    motion: tuple[float, float, float]

    def predict(self, current: Cloud, goal: Cloud) -> Point:
        return np.array(self.motion)


def pulled(sideways: float) -> Cloud:
    """The slab pulled up and aside at one point."""
    cloud = slab()
    share = (bumped(cloud) - cloud)[:, 2:] / 0.03
    return (cloud + share * np.array([sideways, 0.0, 0.03])).astype(np.float32)


@pytest.mark.parametrize("sideways", [0.0, 0.02])
def test_the_point_that_was_pulled_is_found_however_it_moved(sideways: float) -> None:
    found = MotionVote(Asks((sideways, 0.0, 0.03))).pick(slab(), pulled(sideways))
    assert np.linalg.norm(found.point - CENTRE) < 0.006
    assert 0.9 < found.confidence <= 1.0


def test_every_point_of_the_cloud_has_a_score_and_only_those_within_reach_above_zero() -> None:
    cloud = slab()
    found = MotionVote(Asks((0.0, 0.0, 0.03))).pick(cloud, pulled(0.0))
    assert found.scores is not None
    assert len(found.scores) == len(cloud)
    assert not found.scores[cloud[:, 0] < cloud[:, 0].min() + Workspace().clearance].any()
    assert np.linalg.norm(cloud[found.scores.argmax()] - CENTRE) < 0.01


def test_a_motion_that_leads_nowhere_near_the_goal_is_not_trusted() -> None:
    assert MotionVote(Asks((0.0, 0.0, 0.08))).pick(slab(), pulled(0.0)).confidence < 0.1


def test_without_motion_there_is_no_answer() -> None:
    with pytest.raises(NoDisplacement, match=r"gripper's end is 0\.0 mm"):
        MotionVote(Asks((0.0, 0.0, 0.0))).pick(slab(), slab())


def test_an_object_out_of_reach_is_refused() -> None:
    vote = MotionVote(Asks((0.0, 0.0, 0.03)), workspace=Workspace(clearance=0.2))
    with pytest.raises(OutOfReach):
        vote.pick(slab(), pulled(0.0))
