"""Plans reach what they say they reach, go around what is in the way, and name their failures."""

import numpy as np
import pytest

from dnet.planning.planner import ArmPlanner, PlannerSettings
from dnet.types import Plan
from tests.planning.arms import ARM, HOLDING, START, Boxes, tip, wall

LEFT = np.array([-0.04, 0.0, 0.0])


def plan(boxes: Boxes, motion: np.ndarray = LEFT, *, seed: int = 0, **settings: float) -> Plan:
    planner = ArmPlanner(ARM, boxes, PlannerSettings(**settings))  # type: ignore[arg-type]
    return planner.plan((HOLDING, START), motion, seed=seed)


def test_a_free_way_is_straight() -> None:
    found = plan(Boxes())
    assert found.status == "straight"
    assert found.reason == ""
    np.testing.assert_allclose(found.achieved, LEFT, atol=1e-9)
    np.testing.assert_array_equal(found.requested, LEFT)
    assert len(found.path) == len(found.times)
    assert found.times[-1] > 0.04 / 0.2


def test_a_plan_that_is_cut_goes_some_waypoints_and_says_so() -> None:
    planner = ArmPlanner(ARM, Boxes(), PlannerSettings())
    found = planner.plan((HOLDING, START), LEFT, seed=0, waypoints=10)
    assert found.status == "partial"
    assert found.reason == "cut to the first 10 of 40 waypoints"
    np.testing.assert_allclose(found.achieved, LEFT / 4, atol=1e-9)
    np.testing.assert_array_equal(found.requested, LEFT)
    whole = planner.plan((HOLDING, START), LEFT, seed=0, waypoints=40)
    assert whole.status == "straight"


def test_rrt_connect_goes_around_a_wall_and_arrives() -> None:
    boxes = wall(0.025)
    found = plan(boxes)
    assert found.status == "rrt_connect"
    assert "a box" in found.reason
    np.testing.assert_allclose(found.achieved, LEFT, atol=1e-9)
    assert all(boxes.obstacle(joints) is None for joints in found.path)
    tips = np.array([tip(joints) for joints in found.path])
    off = np.abs(tips[:, 1:] - tips[0, 1:]).max()
    assert 0.005 < off <= 0.015
    # The orientation may turn on the way but not at the end.
    np.testing.assert_allclose(
        ARM.forward(found.path[-1])[:3, :3], ARM.forward(START)[:3, :3], atol=1e-9
    )


def test_the_same_seed_plans_the_same_path_and_another_seed_another() -> None:
    first, again, other = plan(wall(0.025)), plan(wall(0.025)), plan(wall(0.025), seed=1)
    np.testing.assert_array_equal(first.path, again.path)
    assert first.checks == again.checks
    assert other.path.shape != first.path.shape or not np.allclose(other.path, first.path)


def test_a_detour_that_drags_the_tip_too_far_is_refused() -> None:
    found = plan(wall(0.025), excursion=0.004, attempts=2)
    assert found.status == "partial"
    assert "too wide" in found.reason


def test_a_blocked_goal_gets_the_free_part_of_the_line() -> None:
    block = Boxes([(np.array([-0.2, -0.2, -0.2]), np.array([0.02, 0.2, 0.2]))])
    found = plan(block)
    assert found.status == "partial"
    assert "the goal touches a box" in found.reason
    assert -0.025 <= found.achieved[0] <= -0.023
    np.testing.assert_allclose(found.achieved[1:], 0, atol=1e-9)
    np.testing.assert_array_equal(found.requested, LEFT)


def test_a_part_too_small_to_matter_is_a_failure_that_stays_put() -> None:
    block = Boxes([(np.array([-0.2, -0.2, -0.2]), np.array([0.043, 0.2, 0.2]))])
    found = plan(block)
    assert found.status == "failed"
    np.testing.assert_array_equal(found.path, START[None])
    np.testing.assert_array_equal(found.achieved, np.zeros(3))


def test_an_arm_that_stands_in_a_box_does_not_move() -> None:
    block = Boxes([(tip(START) - 0.01, tip(START) + 0.01)])
    found = plan(block)
    assert found.status == "failed"
    assert found.reason == "the arm stands in the way: a box"


def test_a_search_that_runs_out_of_checks_says_so() -> None:
    tall = wall(0.025, top=1.0, width=1.0)
    found = plan(tall, checks=200, attempts=1)
    assert found.status == "partial"
    assert "no path within 200 collision checks" in found.reason
    assert found.checks < 400


def test_every_check_is_counted_and_the_holding_arm_is_made_known() -> None:
    boxes = wall(0.025)
    found = plan(boxes)
    assert found.checks == boxes.asked
    assert len(boxes.holding) == 1
    np.testing.assert_array_equal(boxes.holding[0], HOLDING)


@pytest.mark.parametrize("seed", [0, 2**31, 10**12])
def test_any_seed_will_do(seed: int) -> None:
    assert plan(wall(0.025), seed=seed).status == "rrt_connect"
