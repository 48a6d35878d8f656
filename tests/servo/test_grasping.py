"""The arm comes along its tool, closes where there is tissue, and says why it cannot."""

from dataclasses import dataclass, field

import numpy as np

from dnet.errors import EmptyGrasp
from dnet.servo.grasping import STANDOFF, Hand
from dnet.types import Point
from tests.servo.slab import Slab

DOWN = np.array([0.0, 0.0, -1.0])


@dataclass
class Held(Slab):
    """A slab with tissue where x is positive."""

    holding: bool = True
    closed: list[Point] = field(default_factory=list)

    def release(self) -> None:
        self.holding = False

    def regrasp(self, point: Point) -> None:
        if point[0] < 0:
            raise EmptyGrasp((float(point[0]), 0.0, 0.0), 0.1, 0.016)
        self.closed.append(self.tip.copy())
        self.holding = True


def test_letting_go_opens_the_jaws_and_goes_back_along_the_tool() -> None:
    scene = Held()
    hand = Hand(scene, scene, DOWN, 0)
    hand.let_go()
    assert not scene.holding
    np.testing.assert_allclose(scene.tip, [0, 0, STANDOFF])
    assert [motion.what for motion in hand.motions] == ["retreat"]


def test_the_arm_comes_in_along_its_tool_and_closes_at_the_point() -> None:
    scene, point = Held(), np.array([0.02, 0.01, 0.03])
    hand = Hand(scene, scene, DOWN, 0)
    hand.let_go()
    grasped, _ = hand.grasp([point])
    assert grasped is not None
    np.testing.assert_array_equal(grasped, point)
    np.testing.assert_allclose(scene.closed, [point])
    assert scene.holding
    assert [motion.what for motion in hand.motions] == ["retreat", "approach", "close in"]
    end = hand.motions[-1].plan
    np.testing.assert_allclose(end.achieved, STANDOFF * DOWN)
    assert len(set(scene.seeds)) == 3


def test_the_next_point_is_tried_where_nothing_is_between_the_jaws() -> None:
    scene = Held()
    hand = Hand(scene, scene, DOWN, 0)
    bad, good = np.array([-0.02, 0.0, 0.0]), np.array([0.03, 0.0, 0.0])
    grasped, _ = hand.grasp([bad, good])
    assert grasped is not None
    np.testing.assert_array_equal(grasped, good)


def test_what_cannot_be_reached_is_said() -> None:
    scene = Held(blocked=True)
    grasped, why = Hand(scene, scene, DOWN, 0).grasp([np.array([0.02, 0.0, 0.0])])
    assert grasped is None
    assert why == "a wall"


def test_without_a_point_there_is_no_grasp() -> None:
    scene = Held()
    grasped, why = Hand(scene, scene, DOWN, 0).grasp([])
    assert grasped is None
    assert "no point left" in why
