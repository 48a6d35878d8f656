"""RRT-Connect around obstacles: OMPL's planner in joint space measured in metres of tip motion.

Kuffner and LaValle 2000, as in Sucan, Moll and Kavraki's Open Motion Planning Library.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from dnet.packages import needed_for
from dnet.planning.arm import METRES_PER_UNIT, Arm
from dnet.types import JointPath, Joints

with needed_for("planning"):
    from ompl import base, geometric
    from ompl import util as ompl_util

RESOLUTION = 0.001
"""Between two checked states of a motion, in metres of tip motion."""
RANGE = 0.03
"""Longest branch that the tree grows at once, in metres of tip motion."""
PASSES = 3
"""Rounds of shortening that a found path goes through."""

ompl_util.setLogLevel(ompl_util.LogLevel.LOG_ERROR)


def rrt_connect(
    arm: Arm,
    free: Callable[[Joints], bool],
    start: Joints,
    goal: Joints,
    *,
    seed: int,
    checks: int,
) -> JointPath | None:
    """Return a shortened collision-free path from `start` to `goal`, or None.

    The same seed gives the same path: the search is bounded by its number of collision checks,
    never by the clock.

    Args:
        arm: Whose joint limits bound the search.
        free: Whether joint positions touch nothing; both ends must.
        start: Joint positions, (6,).
        goal: Joint positions, (6,).
        seed: Of the random tree.
        checks: Collision checks after which the search gives up.

    Returns:
        Joint positions, (n, 6), n >= 2.
    """
    made = 0  # States and paths are Any: OMPL's stubs know only their abstract bases.
    size = len(start)

    def valid(state: Any) -> bool:
        nonlocal made
        made += 1
        # OMPL takes nothing but Python's own bool here.
        return bool(free(np.array(state[0:size]) / METRES_PER_UNIT))

    space = base.RealVectorStateSpace(size)
    bounds = base.RealVectorBounds(size)
    for joint in range(size):
        bounds.setLow(joint, float(arm.lower[joint] * METRES_PER_UNIT[joint]))
        bounds.setHigh(joint, float(arm.upper[joint] * METRES_PER_UNIT[joint]))
    space.setBounds(bounds)
    information = base.SpaceInformation(space)
    information.setStateValidityChecker(valid)
    information.setStateValidityCheckingResolution(RESOLUTION / space.getMaximumExtent())
    information.setup()

    def state(joints: Joints) -> Any:
        allocated: Any = information.allocState()
        allocated[0:size] = (joints * METRES_PER_UNIT).tolist()
        return allocated

    _seed(seed)
    problem = base.ProblemDefinition(information)
    problem.setStartAndGoalStates(state(start), state(goal))
    planner = geometric.RRTConnect(information)
    planner.setRange(RANGE)
    planner.setProblemDefinition(problem)
    planner.setup()
    status = planner.solve(base.PlannerTerminationCondition(lambda: made >= checks))
    # An approximate solution counts as true, too: only an exact one will do.
    if status.getStatus() != base.PlannerStatus.EXACT_SOLUTION:
        return None
    path: Any = problem.getSolutionPath()
    simplifier = geometric.PathSimplifier(information)
    for _ in range(PASSES):
        simplifier.reduceVertices(path)
        simplifier.partialShortcutPath(path)
        simplifier.collapseCloseVertices(path)
    joints = np.array([found[0:size] for found in path.getStates()]) / METRES_PER_UNIT
    joints[0], joints[-1] = start, goal
    return joints


def _seed(seed: int) -> None:
    """Seed OMPL's generators; it warns of any call but the first, though all of them work."""
    level = ompl_util.getLogLevel()
    ompl_util.setLogLevel(ompl_util.LogLevel.LOG_NONE)
    ompl_util.RNG.setSeed(seed % 2**31 + 1)
    ompl_util.setLogLevel(level)
