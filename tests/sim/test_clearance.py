"""The moving arm is clear where the tissue is, and not where something stands."""

from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest

from dnet.errors import Unreachable
from dnet.geometry.camera import Camera
from dnet.planning.planner import ArmPlanner
from dnet.sim.arms import Placement
from dnet.sim.clearance import Clearance
from dnet.sim.psm import LOWER, UPPER
from dnet.sim.scenes import Workspace, draw_displacement, draw_scene
from dnet.types import Tissue

PLACE = Placement()


@pytest.fixture(scope="module")
def clearance() -> Iterator[Clearance]:
    with closing(Clearance(PLACE, Camera())) as made:
        made.stand(PLACE.joints_at(0, np.array([-0.045, 0.0, 0.04])))
        yield made


def at(clearance: Clearance, *tip: float) -> str | None:
    return clearance.obstacle(PLACE.joints_at(1, np.array(tip)))


def test_the_grasp_is_clear(clearance: Clearance) -> None:
    assert at(clearance, 0.045, 0.0, 0.04) is None


def test_the_table_is_in_the_way_below(clearance: Clearance) -> None:
    blocked = at(clearance, 0.045, 0.0, 0.0)
    assert blocked is not None
    assert "the table" in blocked
    assert "jaw" in blocked


def test_the_other_arm_is_in_the_way_where_it_stands(clearance: Clearance) -> None:
    blocked = at(clearance, -0.043, 0.0, 0.045)
    assert blocked is not None
    assert "the holding arm" in blocked


def test_the_other_arm_is_not_in_the_way_where_it_no_longer_stands(clearance: Clearance) -> None:
    clearance.stand(PLACE.joints_at(0, np.array([-0.10, 0.05, 0.10])))
    assert at(clearance, -0.043, 0.0, 0.045) is None
    clearance.stand(PLACE.joints_at(0, np.array([-0.045, 0.0, 0.04])))


def test_the_camera_is_in_the_way_where_it_hangs() -> None:
    """A camera right beside the tool; the usual one hangs out of the arm's reach."""
    near = Camera(eye=(0.08, -0.03, 0.08), target=(0.0, 0.0, 0.02))
    with closing(Clearance(PLACE, near)) as made:
        blocked = at(made, 0.045, -0.01, 0.04)
    assert blocked is not None
    assert "camera" in blocked


def test_every_random_motion_from_a_clear_grasp_is_reachable_and_clear(
    clearance: Clearance,
) -> None:
    planner = ArmPlanner(PLACE.arms[1], clearance)
    random = np.random.default_rng(3)
    workspace = Workspace()
    blocked = 0
    for _ in range(60):
        scene = draw_scene(workspace, Tissue(), random)
        start = PLACE.joints_at(1, np.array(scene.manipulation_point))
        holding = PLACE.joints_at(0, np.array(scene.hold))
        displacement = draw_displacement(workspace, random)
        clearance.stand(holding)
        if clearance.obstacle(start):
            # Low on the end face the jaws meet the table: such a scene is drawn again.
            assert scene.manipulation_point[2] < 0.02
            blocked += 1
            continue
        plan = planner.plan((holding, start), displacement, seed=0)
        assert plan.status == "straight", plan.reason
    assert blocked < 20


def test_what_boxes_around_the_links_leave_out_bullet_finds_clear(clearance: Clearance) -> None:
    """Asked about every row, Bullet finds no more in the way than where it is asked."""
    random = np.random.default_rng(5)
    path = np.stack([random.uniform(LOWER, UPPER) for _ in range(400)])
    holding = path[0] * 0.3
    try:
        clearance.stand(holding)
        everywhere = [clearance._touched(joints) is not None for joints in path]
        asked = clearance._suspects(path)
        assert not np.any(np.array(everywhere) & ~asked)
        assert 10 < np.sum(everywhere) < 390
        assert np.mean(asked) < 0.95
        first = clearance.first_obstacle(path)
        assert first is not None
        assert first[0] == everywhere.index(True)
    finally:
        clearance.stand(PLACE.joints_at(0, np.array([-0.045, 0.0, 0.04])))


def test_bullet_is_asked_of_few_positions_of_a_usual_motion(clearance: Clearance) -> None:
    tips = np.array([0.045, 0.0, 0.04]) + np.linspace(0, 1, 50)[:, None] * [0.0, 0.04, 0.03]
    path = np.stack([PLACE.joints_at(1, tip) for tip in tips])
    assert not clearance._suspects(path).any()


def test_the_arm_cannot_reach_the_other_side_of_the_table() -> None:
    with pytest.raises(Unreachable):
        PLACE.joints_at(1, np.array([-0.3, 0.0, 0.04]))
