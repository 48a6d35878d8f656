"""A real arm among made-up obstacles, for plans that can be judged by hand."""

from dataclasses import dataclass, field

import numpy as np

from dnet.sim.arms import Placement
from dnet.types import JointPath, Joints, Point

PLACEMENT = Placement()
ARM = PLACEMENT.arms[1]
START = PLACEMENT.joints_at(1, np.array([0.045, 0.0, 0.06]))
HOLDING = PLACEMENT.joints_at(0, np.array([-0.045, 0.0, 0.04]))


def tip(joints: Joints) -> Point:
    return ARM.forward(joints)[:3, 3]


@dataclass
class Boxes:
    """Boxes that the tip of the tool must stay out of."""

    boxes: list[tuple[Point, Point]] = field(default_factory=list)
    asked: int = 0
    holding: list[Joints] = field(default_factory=list)

    def stand(self, holding: Joints) -> None:
        self.holding.append(holding)

    def obstacle(self, joints: Joints) -> str | None:
        self.asked += 1
        where = tip(joints)
        for low, high in self.boxes:
            if np.all(where > low) and np.all(where < high):
                return "a box"
        return None

    def first_obstacle(self, path: JointPath) -> tuple[int, str] | None:
        for row, joints in enumerate(path):
            found = self.obstacle(joints)
            if found is not None:
                return row, found
        return None


def wall(x: float, *, thickness: float = 0.004, top: float = 0.066, width: float = 0.01) -> Boxes:
    """A thin wall across the way of a tip that moves along x; low and narrow, to go around."""
    low = np.array([x - thickness / 2, -width, 0.0])
    high = np.array([x + thickness / 2, width, top])
    return Boxes([(low, high)])
