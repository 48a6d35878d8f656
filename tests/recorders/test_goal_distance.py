"""What a viewer shows of the distance to a goal is what the figures say."""

from dataclasses import replace

import numpy as np
import pytest

from dnet.geometry.chamfer import chamfer, legacy_chamfer
from dnet.geometry.node_distance import node_distance
from dnet.recorders.goal_distance import WORST, GoalDistance, colors_of
from dnet.types import Goal
from tests.recorders.rollout import frames

START, *_, END = frames(3)
GOAL = Goal(END.cloud, "test", grasp=END.grasp, nodes=END.nodes, again=END.cloud[::2].copy())


def test_the_curves_are_the_figures_of_the_tables() -> None:
    found = GoalDistance(GOAL)(START)
    assert found.figures["chamfer"] == pytest.approx(1e3 * chamfer(START.cloud, GOAL.cloud))
    assert found.figures["legacy"] == pytest.approx(legacy_chamfer(START.cloud, GOAL.cloud))
    assert found.figures["nodes"] == pytest.approx(1e3 * node_distance(START.nodes, GOAL.nodes))
    assert found.motion is not None
    np.testing.assert_array_equal(found.motion, END.grasp - START.grasp)


def test_the_floor_is_that_of_the_goal_seen_again() -> None:
    assert GOAL.again is not None
    floor = GoalDistance(GOAL).floor
    assert floor["chamfer"] == pytest.approx(1e3 * chamfer(GOAL.again, GOAL.cloud))
    assert GoalDistance(replace(GOAL, again=None)).floor == {}


def test_what_is_not_known_is_left_out() -> None:
    found = GoalDistance(Goal(GOAL.cloud, "somebody's"))(START)
    assert set(found.figures) == {"chamfer", "legacy"}
    assert found.motion is None
    assert np.isnan(node_distance(START.nodes, None))
    assert np.isnan(node_distance(START.nodes, START.nodes[:-1]))


def test_points_at_the_goal_are_blue_and_the_worst_are_red() -> None:
    near, far, farther = colors_of(np.array([0.0, WORST, 2 * WORST]))
    assert near[2] > near[0]
    assert far[0] > far[2]
    np.testing.assert_array_equal(far, farther)
    there = GoalDistance(GOAL)(END).colors
    np.testing.assert_array_equal(there, np.tile(near, (len(END.cloud), 1)))
