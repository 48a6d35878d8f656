"""Letting go of the object and grasping it: every motion of the arm planned, like any other."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

from dnet.errors import EmptyGrasp, Unreachable
from dnet.servo.loop import Planner
from dnet.servo.loop import Scene as Moving
from dnet.types import Joints, Plan, Point

STANDOFF = 0.03
"""From where the approach along the tool begins to the grasp, in metres."""
CANDIDATES = 200
"""Points that are tried before the object counts as out of reach."""


@runtime_checkable
class Graspable(Moving, Protocol):
    """A scene whose object can be let go of and grasped."""

    @property
    def time(self) -> float:
        """Seconds of simulation."""
        ...

    @property
    def joints(self) -> tuple[Joints, Joints]:
        """Joint positions of the holding and the moving arm."""
        ...

    @property
    def tip(self) -> Point:
        """Where the moving arm's jaws meet, in the world."""
        ...

    def release(self) -> None:
        """Open the moving arm's jaws."""
        ...

    def regrasp(self, point: Point) -> None:
        """Close the jaws at a point of the object at rest; raise if nothing is there."""
        ...


@dataclass(frozen=True, slots=True)
class Motion:
    """One planned motion of the arm outside of the loop, as it was carried out."""

    what: str
    """For people: `retreat`, `approach`, `close in`."""
    joints: tuple[Joints, Joints]
    """Of both arms at its start."""
    plan: Plan
    time: float
    """Seconds of simulation at its start."""


@dataclass(frozen=True)
class Hand:
    """The moving arm's jaws: away from the object, to a point of it, closed there."""

    scene: Graspable
    planner: Planner
    along: Point
    """The direction in which the jaws point, as a unit vector in the world."""
    seed: int
    motions: list[Motion] = field(default_factory=list)
    """What was done, in order."""

    def let_go(self) -> None:
        """Open the jaws and go back along the tool, as far as there is room."""
        self.scene.release()
        self._go("retreat", -STANDOFF * self.along)
        self.scene.settle()

    def grasp(self, points: Sequence[Point]) -> tuple[Point | None, str]:
        """Grasp the object at the first of `points` that can be reached and has tissue around it.

        The arm goes to a point before it, from there straight along the tool, and closes its jaws.

        Returns:
            Where it was grasped, or None; and why the last point would not do.
        """
        reason = "there is no point left that was not tried before"
        for point in points[:CANDIDATES]:
            fault = self._grasped(point)
            if fault is None:
                return point, reason
            reason = fault
        return None, reason

    def _grasped(self, point: Point) -> str | None:
        before = self._go("approach", point - STANDOFF * self.along - self.scene.tip)
        if before is not None:
            return before
        there = self._go("close in", point - self.scene.tip)
        if there is not None:
            return there
        try:
            self.scene.regrasp(point)
        except (EmptyGrasp, Unreachable) as error:
            return str(error)
        self.scene.settle()
        return None

    def _go(self, what: str, motion: Point) -> str | None:
        """Move the tip; return why it could not be moved all the way."""
        joints = self.scene.joints
        seed = self.seed * 10_000 + 5_000 + len(self.motions)
        plan = self.planner.plan(joints, motion, seed=seed)
        if what != "retreat" and plan.status in ("partial", "failed"):
            return plan.reason
        self.motions.append(Motion(what, joints, plan, self.scene.time))
        self.scene.follow(plan.path, plan.times)
        return None
