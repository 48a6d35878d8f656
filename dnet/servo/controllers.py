"""What decides the next motion of the gripper from the current and the goal cloud."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from dnet.types import Cloud, Point


@runtime_checkable
class Controller(Protocol):
    """Maps two clouds of one object to the motion that takes one shape to the other.

    A network sees the clouds alone. Whatever else a controller knows it is given when it is made:
    where the tip is, as any robot knows, or the truth, as only a simulator does.
    """

    def predict(self, current: Cloud, goal: Cloud) -> Point:
        """Return the motion of the grasp, in metres, (3,).

        Args:
            current: What is seen now, in farthest-point order, (n, 3).
            goal: The shape to reach, likewise.
        """
        ...


class Nothing:
    """Never moves: what a goal is worth to someone who does nothing."""

    def predict(self, current: Cloud, goal: Cloud) -> Point:
        """Return no motion."""
        del current, goal
        return np.zeros(3)


@dataclass(frozen=True)
class Oracle:
    """Knows where the manipulation point is in the goal: the most that a controller can know."""

    tip: Callable[[], Point]
    """Returns where the grasp is now, in metres, (3,)."""
    target: Point
    """Where it is in the goal."""

    def predict(self, current: Cloud, goal: Cloud) -> Point:
        """Return the true motion."""
        del current, goal
        motion: Point = self.target - self.tip()
        return motion
