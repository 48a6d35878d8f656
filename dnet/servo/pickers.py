"""What decides where to grasp the object from its initial and its goal cloud.

A method is a class with `pick`; `dnet.trials.methods` gives it a name on the command line.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from dnet.types import Cloud, KeypointPairs, Point

APART = 0.015
"""A point this near to one that was tried before is the same grasp, in metres: the jaws' reach."""


@dataclass(frozen=True, slots=True)
class Choice:
    """Where to grasp, and how sure that is."""

    point: Point
    """On or near the surface of the initial cloud, in metres."""
    confidence: float
    """From 0 to 1."""
    scores: Float64[np.ndarray, "_"] | None = None
    """How good each point of the initial cloud would be, the best highest, (n,)."""
    keypoints: KeypointPairs | None = None
    """What it was chosen by, if by keypoints."""


@runtime_checkable
class Picker(Protocol):
    """Maps two clouds of one object to the point to grasp it at."""

    def pick(self, initial: Cloud, goal: Cloud) -> Choice:
        """Return the manipulation point.

        Args:
            initial: What is seen before the grasp, in farthest-point order, (n, 3).
            goal: The shape to reach, likewise.
        """
        ...


@dataclass(frozen=True)
class TruePoint:
    """Knows the point at which the goal was made: what a method is measured against."""

    point: Point

    def pick(self, initial: Cloud, goal: Cloud) -> Choice:
        """Return the true point."""
        del initial, goal
        return Choice(self.point, 1.0)


def candidates(
    choice: Choice, initial: Cloud, tried: Sequence[Point]
) -> Float64[np.ndarray, "_ 3"]:
    """Return where to grasp, best first: the chosen point, then points of the cloud.

    The points of the cloud come by their scores or, where a method gives none, by how near they
    are to its choice. Those near to a point that was tried before are left out.

    Args:
        choice: Of a picker.
        initial: The cloud that it saw.
        tried: Where the object was grasped before.
    """
    points = initial.astype(np.float64)
    if choice.scores is None:
        order = np.argsort(np.linalg.norm(points - choice.point, axis=1), kind="stable")
    else:
        order = np.argsort(-choice.scores, kind="stable")
    ranked = np.concatenate([choice.point[None], points[order]])
    far = np.ones(len(ranked), bool)
    for point in tried:
        far &= np.linalg.norm(ranked - point, axis=1) > APART
    return ranked[far]
