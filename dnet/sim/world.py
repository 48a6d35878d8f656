"""What a world must do: be set up, be moved by the arms, come to rest, and be looked at."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from dnet.geometry.camera import DepthImage
from dnet.types import JointPath, Joints, Nodes, Point, Scene


@dataclass(frozen=True, slots=True)
class Settling:
    """How the object came to rest."""

    settled: bool
    """Whether the last block of steps moved no node by more than the tolerance."""
    steps: int
    """Simulation steps that it took."""
    least_volume_ratio: float
    """Smallest ratio of a tetrahedron's volume to its rest volume; below zero it is inverted."""


@runtime_checkable
class World(Protocol):
    """A place where one arm holds an object and the other deforms it."""

    def reset(self, scene: Scene) -> None:
        """Set the object down at rest, held and grasped as the scene says.

        Raises:
            Unreachable: If an arm cannot reach its point.
            EmptyGrasp: If nothing is between the jaws there.
        """
        ...

    def restore(self) -> None:
        """Put the object back at rest and the arms where they grasped it; the clock goes on."""
        ...

    @property
    def time(self) -> float:
        """Seconds of simulation since the reset."""
        ...

    @property
    def joints(self) -> tuple[Joints, Joints]:
        """Joint positions of the holding and the moving arm."""
        ...

    @property
    def tip(self) -> Point:
        """Where the moving arm's jaws meet, in the world."""
        ...

    @property
    def object_id(self) -> int:
        """The object's number in the mask of a depth image."""
        ...

    def nodes(self) -> Nodes:
        """Return the mesh nodes, in metres, (n, 3)."""
        ...

    def follow(self, path: JointPath, times: Float64[np.ndarray, "_"]) -> None:
        """Drive the moving arm along a timed joint path; what it grasps goes with it."""
        ...

    def settle(self) -> Settling:
        """Let the object come to rest with the arms still."""
        ...

    def foresee(self, displacement: Point) -> float:
        """Return the least volume ratio of the shape that a displacement from rest leads to."""
        ...

    def deviation(self) -> float:
        """Return how far the settled shape is from where the grasp takes it straight from rest.

        The worst node's distance in metres: large where the grasp allows several shapes.
        """
        ...

    def look(self) -> DepthImage:
        """Return what the depth camera sees."""
        ...


@runtime_checkable
class GraspingWorld(World, Protocol):
    """A world in which the moving arm can let go of the object, and grasp it elsewhere."""

    def release(self) -> None:
        """Open the moving arm's jaws: the object is held by the other arm alone."""
        ...

    def regrasp(self, point: Point) -> None:
        """Close the moving arm's jaws at a point of the object, at rest, as `reset` does.

        The clock goes on.

        Raises:
            Unreachable: If the arm cannot reach the point.
            EmptyGrasp: If nothing is between the jaws there.
        """
        ...

    def slip(self) -> float:
        """Return how far what the moving arm grasped is from between its jaws, in metres."""
        ...

    def borne(self, motion: Point) -> float:
        """Return how much of a straight motion of the tip the object bears, as a share.

        1 for all of it, or if the jaws are open; else up to where it would be crushed.
        """
        ...
