"""The straight line of the tip: the motion that is asked for, if nothing is in its way."""

from dataclasses import dataclass

import numpy as np

from dnet.planning.arm import METRES_PER_UNIT, Arm, FirstObstacle
from dnet.types import JointPath, Joints, Point

SPACING = 0.001
"""Between two checked positions of the tip, in metres."""
LARGEST_JUMP = 0.02
"""Between two neighbouring joint positions, in metres of tip motion: more is another branch of
the inverse kinematics, or a singularity."""


@dataclass(frozen=True, slots=True)
class Line:
    """As much of a straight line as the arm can follow."""

    path: JointPath
    """From the start to the last good position, (n, 6), n >= 1."""
    fraction: float
    """How much of the line that is, 1 for all of it."""
    stop: str
    """What ended it, empty where nothing did."""


def straight_line(
    arm: Arm, first_obstacle: FirstObstacle, start: Joints, displacement: Point
) -> Line:
    """Return the joint path that moves the tip straight by `displacement`, orientation kept.

    Args:
        arm: Whose tip moves.
        first_obstacle: Says what is in the way of positions SPACING apart.
        start: Joint positions to start from.
        displacement: Of the tip in the world, in metres.
    """
    count = max(1, int(np.ceil(np.linalg.norm(displacement) / SPACING)))
    tips = np.repeat(arm.forward(start)[None], count, axis=0)
    tips[:, :3, 3] += displacement * (np.arange(1, count + 1) / count)[:, None]
    found, fault = arm.inverse_along(tips, near=start)
    path, stop = np.vstack([start, found]), "" if fault is None else str(fault)
    jumps = np.linalg.norm(np.diff(path, axis=0) * METRES_PER_UNIT, axis=1)
    if (jumps > LARGEST_JUMP).any():
        last = int((jumps > LARGEST_JUMP).argmax())
        path = path[: last + 1]
        stop = f"the joints would jump by {jumps[last] * 1e3:.0f} mm of tip motion"
    blocked = first_obstacle(path[1:])
    if blocked is not None:
        last, stop = blocked
        path = path[: last + 1]
    return Line(path, 1.0 if not stop else (len(path) - 1) / count, stop)
