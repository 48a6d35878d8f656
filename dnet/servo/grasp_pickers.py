"""Trained networks and simple baselines as methods of choosing where to grasp."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from scipy.spatial import cKDTree

from dnet.errors import NoDisplacement
from dnet.geometry.chamfer import chamfer, nearest_distances
from dnet.geometry.hidden_sides import hidden_sides
from dnet.nets.manipulation_point import Chosen
from dnet.servo.pickers import Choice
from dnet.types import Cloud, Point

FLOOR = 0.0013
"""Chamfer distance below which two clouds are of one shape, in metres: two samplings of a shape
are about 1 mm apart."""
NEAR = 0.01
"""What is near, in metres: about the radius of what the jaws hold."""


@runtime_checkable
class Chooser(Protocol):
    """A trained network."""

    def choose(self, initial: Cloud, goal: Cloud) -> Chosen:
        """Return where to grasp."""
        ...


@dataclass(frozen=True)
class NetworkPicker:
    """Grasps the point of the surface that is nearest to a network's choice.

    The surface is the initial cloud, and the sides that are hidden from the camera. Its
    confidence is, of a network that gives probabilities, the probability within `2 * NEAR` of the
    choice; of a regressor, exp(-d / NEAR), where its answer lies d off the surface.
    """

    network: Chooser

    def pick(self, initial: Cloud, goal: Cloud) -> Choice:
        """Return the manipulation point.

        Raises:
            NoDisplacement: If the goal is the initial shape.
            ShortCloud, LongCloud: If a cloud has not the number of points that the network takes.
            BadCloud: If a coordinate is NaN or infinite.
        """
        refuse_no_displacement(initial, goal)
        chosen = self.network.choose(initial, goal)
        if chosen.candidates is None or chosen.probabilities is None:
            surface = np.concatenate([initial, hidden_sides(initial)])
            distances = np.linalg.norm(surface - chosen.point, axis=1)
            point = _point(surface, int(distances.argmin()))
            return Choice(point, float(np.exp(-distances.min() / NEAR)))
        probabilities = chosen.probabilities.astype(np.float64)
        about = np.linalg.norm(chosen.candidates - chosen.point, axis=1) < 2 * NEAR
        confidence = min(1.0, float(probabilities[about].sum()))
        # A point that was not scored is as good as the nearest that was.
        _, nearest = cKDTree(chosen.candidates).query(initial)
        return Choice(chosen.point, confidence, probabilities[nearest])


@dataclass(frozen=True)
class MostDisplaced:
    """Grasps the point of the initial cloud that is farthest from the goal cloud: a baseline."""

    def pick(self, initial: Cloud, goal: Cloud) -> Choice:
        """Return the manipulation point; raise NoDisplacement if the goal is the initial shape."""
        refuse_no_displacement(initial, goal)
        distances = nearest_distances(initial, goal).astype(np.float64)
        return Choice(_point(initial, int(distances.argmax())), 0.0, distances)


@dataclass(frozen=True)
class FarthestPoint:
    """Grasps the point of the cloud that is farthest from the true one: what a bad grasp costs."""

    truth: Point

    def pick(self, initial: Cloud, goal: Cloud) -> Choice:
        """Return the manipulation point."""
        del goal
        distances = np.linalg.norm(initial - self.truth, axis=1)
        return Choice(_point(initial, int(distances.argmax())), 0.0, distances)


@dataclass
class RandomPoint:
    """Grasps any point of the initial cloud: what every method must beat."""

    seed: int = 0

    def __post_init__(self) -> None:
        self._random = np.random.default_rng(self.seed)

    def pick(self, initial: Cloud, goal: Cloud) -> Choice:
        """Return the manipulation point."""
        del goal
        return Choice(_point(initial, int(self._random.integers(len(initial)))), 0.0)


def refuse_no_displacement(initial: Cloud, goal: Cloud) -> None:
    """Raise NoDisplacement if two clouds are of one shape: any grasp would do as well."""
    apart = chamfer(initial, goal)
    if apart < FLOOR:
        raise NoDisplacement("the goal is at a Chamfer distance of", apart, FLOOR)


def _point(cloud: Cloud, row: int) -> Point:
    return cloud[row].astype(np.float64)
