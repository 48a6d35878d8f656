"""Where to grasp: where the motion that a goal asks of the gripper takes the surface onto it.

A controller such as DeformerNet says how far the gripper must move without being told where it
grasps. What it grasps moves along, so that a patch of the surface about the right point, shifted
by that motion, lies on the goal cloud; about a point that moves less, it does not.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.spatial import cKDTree

from dnet.errors import NoDisplacement, OutOfReach
from dnet.geometry.chamfer import nearest_distances
from dnet.servo.controllers import Controller
from dnet.servo.pickers import Choice
from dnet.servo.reach import reachable
from dnet.sim.scenes import Workspace
from dnet.types import Cloud


@dataclass(frozen=True)
class MotionVote:
    """Grasps the mean of the points that lie on the goal once the motion has shifted them.

    Its confidence is how well the patch about the choice fits, from 1 on the goal to 0 far off.
    """

    controller: Controller
    """Says how far the gripper must move."""
    patch: int = 25
    """Points about each that are shifted along."""
    tolerance: float = 0.002
    """Distance from the goal at which a point counts 0.6 of one that is on it, in metres: about
    the error of a motion."""
    least: float = 0.003
    """Motion below which the goal is reached already, in metres."""
    workspace: Workspace = field(default_factory=Workspace)
    """Where the gripper can reach."""

    def pick(self, initial: Cloud, goal: Cloud) -> Choice:
        """Return the manipulation point.

        Raises:
            NoDisplacement: If hardly any motion is asked for.
            OutOfReach: If no point of the initial cloud can be reached.
            DnetError: If the controller refuses the clouds.
        """
        motion = self.controller.predict(initial, goal)
        length = float(np.linalg.norm(motion))
        if length < self.least:
            raise NoDisplacement("the gripper's end is", length, self.least)
        within = reachable(initial, self.workspace)
        surface = initial[within].astype(np.float64)
        if not len(surface):
            raise OutOfReach(len(initial))
        off = nearest_distances((surface + motion).astype(np.float32), goal)
        _, about = cKDTree(surface).query(surface, k=min(self.patch, len(surface)))
        patches = off[np.asarray(about).reshape(len(surface), -1)].mean(axis=1)
        # Less the least, so that something counts wherever the goal is.
        votes = np.exp(-(patches**2 - patches.min() ** 2) / (2 * self.tolerance**2))
        mean = votes @ surface / votes.sum()
        chosen = int(np.linalg.norm(surface - mean, axis=1).argmin())
        scores = np.zeros(len(initial))
        scores[within] = votes
        fit = float(np.exp(-((patches[chosen] / (5 * self.tolerance)) ** 2) / 2))
        return Choice(surface[chosen], fit, scores)
