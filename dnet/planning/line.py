"""The straight line of the tip: the motion that is asked for, if nothing is in its way."""

from dataclasses import dataclass

import numpy as np

from dnet.errors import Unreachable
from dnet.planning.arm import METRES_PER_UNIT, Arm, Obstacle
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


def straight_line(arm: Arm, obstacle: Obstacle, start: Joints, displacement: Point) -> Line:
    """Return the joint path that moves the tip straight by `displacement`, orientation kept.

    Args:
        arm: Whose tip moves.
        obstacle: Says what is in the way, asked at every position, SPACING apart.
        start: Joint positions to start from.
        displacement: Of the tip in the world, in metres.
    """
    tip = arm.forward(start)
    count = max(1, int(np.ceil(np.linalg.norm(displacement) / SPACING)))
    path = [start]
    for step in range(1, count + 1):
        target = tip.copy()
        target[:3, 3] += displacement * step / count
        try:
            joints = arm.inverse(target, near=path[-1])
        except Unreachable as error:
            return Line(np.array(path), (step - 1) / count, str(error))
        stop = _jump(path[-1], joints) or obstacle(joints)
        if stop:
            return Line(np.array(path), (step - 1) / count, stop)
        path.append(joints)
    return Line(np.array(path), 1.0, "")


def _jump(before: Joints, after: Joints) -> str | None:
    jump = float(np.linalg.norm((after - before) * METRES_PER_UNIT))
    if jump > LARGEST_JUMP:
        return f"the joints would jump by {jump * 1e3:.0f} mm of tip motion"
    return None
