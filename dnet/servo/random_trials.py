"""A controller without a model: random trials in displacement space, the better ones kept."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from dnet.geometry.chamfer_to import ChamferTo
from dnet.types import Cloud, Point


@dataclass(frozen=True, slots=True)
class Tried:
    """A place of the grasp, and how far the shape that it led to is from the goal."""

    tip: Point
    chamfer: float


class RandomTree:
    """A rapidly exploring random tree (LaValle 1998) whose every branch is tried on the object.

    A target is drawn in a box about the first grasp, every other time the tree grows towards it
    from its best node, else from the nearest; a new node is kept if it is nearer to the goal shape
    than its parent. When the trials are used up it goes back to the best node and stays there.
    """

    def __init__(
        self,
        tip: Callable[[], Point],
        *,
        low: Point,
        high: Point,
        trials: int,
        seed: int,
        reach: float = 0.02,
    ) -> None:
        """Say where to search.

        Args:
            tip: Returns where the grasp is now, in metres, (3,).
            low: Least displacement from the first grasp, in metres.
            high: Greatest.
            trials: Motions to try before it settles for the best.
            seed: Of the targets.
            reach: Longest branch, in metres.
        """
        self._tip, self._low, self._high, self._reach = tip, low, high, reach
        self._random = np.random.default_rng(seed)
        self._trials = trials
        self._kept: list[Tried] = []
        self._parent: Tried | None = None

    def predict(self, current: Cloud, goal: Cloud) -> Point:
        """Return the motion to the next place to try."""
        here = Tried(self._tip(), ChamferTo(goal)(current))
        if self._parent is None or here.chamfer < self._parent.chamfer:
            self._kept.append(here)
        best = min(self._kept, key=lambda node: node.chamfer)
        if self._trials == 0:
            self._parent = best
            return best.tip - here.tip
        self._trials -= 1
        target = self._kept[0].tip + self._random.uniform(self._low, self._high)
        self._parent = best if self._trials % 2 else self._nearest(target)
        branch = target - self._parent.tip
        length = float(np.linalg.norm(branch))
        branch *= min(1.0, self._reach / max(length, 1e-12))
        motion: Point = self._parent.tip + branch - here.tip
        return motion

    def _nearest(self, target: Point) -> Tried:
        return min(self._kept, key=lambda node: float(np.linalg.norm(node.tip - target)))
