"""Plans that spare the object: no motion goes farther than tissue can follow."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from dnet.servo.loop import Planner
from dnet.types import Joints, Plan, Point

LEAST_MOTION = 0.002
"""Least motion worth moving, in metres."""


@dataclass(frozen=True)
class SparingPlanner:
    """A `Planner` whose motions end where the object would be crushed.

    What is cut off so is `partial`, and `failed` if hardly anything is left; in both cases the
    reason says so. A plan that the object bears is the one that `planner` makes.
    """

    planner: Planner
    """Plans among obstacles."""
    borne: Callable[[Point], float]
    """Returns how much of a motion of the tip the object bears, as a share: 1 for all of it."""

    def plan(
        self, joints: tuple[Joints, Joints], displacement: Point, *, seed: int, waypoints: int = 0
    ) -> Plan:
        """Return how to move the tip by `displacement`, or as far as the object bears it."""
        plan = self.planner.plan(joints, displacement, seed=seed, waypoints=waypoints)
        if plan.status == "failed":
            return plan
        clock = perf_counter()
        share = self.borne(plan.achieved)
        plan = replace(plan, milliseconds=plan.milliseconds + (perf_counter() - clock) * 1e3)
        if share == 1.0:
            return plan
        whole = float(np.linalg.norm(plan.achieved))
        reason = f"beyond {share * whole * 1e3:.1f} of {whole * 1e3:.1f} mm the object is crushed"
        if share * whole < LEAST_MOTION:
            return _staying(plan, reason)
        shorter = self.planner.plan(joints, share * plan.achieved, seed=seed, waypoints=waypoints)
        return replace(
            shorter,
            status="failed" if shorter.status == "failed" else "partial",
            requested=plan.requested,
            reason=f"{reason}; {shorter.reason}" if shorter.reason else reason,
            checks=plan.checks + shorter.checks,
            milliseconds=plan.milliseconds + shorter.milliseconds,
        )


def _staying(plan: Plan, reason: str) -> Plan:
    """Return a plan that goes nowhere, instead of another from the same place."""
    return replace(
        plan,
        status="failed",
        path=plan.path[:1],
        times=np.zeros(1),
        achieved=np.zeros(3),
        reason=reason,
    )
