"""When a run has ended, and how: a function of what has been seen and done so far."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from dnet.types import Outcome, Step


@dataclass(frozen=True)
class ServoSettings:
    """When a run ends, and how much of each plan is carried out."""

    steps: int = 12
    """Motions after which it gives up."""
    threshold: float = 0.002
    """It has converged when the predicted motion is below this on every axis, in metres."""
    chamfer: float = 0.0
    """The goal is reached when the Chamfer distance to it is below this, in metres; 0 for never."""
    patience: int = 5
    """It has stalled after so many motions that bring the object no nearer; 0 for never."""
    progress: float = 1e-4
    """What counts as nearer, in metres of Chamfer distance."""
    seconds: float = 0.0
    """Of simulation, after which time has run out; 0 for never."""
    holds: int = 2
    """Plans in a row that may fail before the run does."""
    waypoints: int = 0
    """Checked positions of each plan, 1 mm apart, to go before looking again; 0 for all."""
    looks: int = 3
    """Images in a row that may show too little of the object before it counts as lost."""
    regrasps: int = 0
    """How often to grasp the object elsewhere when the run stalls."""
    slip: float = 0.01
    """The grasp is lost when what it held is farther than this from between the jaws, in metres."""


def verdict(
    steps: Sequence[Step], step: Step, *, start: float, settings: ServoSettings
) -> Outcome | None:
    """Return how a run has ended, or None if it goes on.

    Args:
        steps: The turns under the present grasp, each with its plan.
        step: What is seen now, and what motion is asked for.
        start: Seconds of simulation at which the run began.
        settings: When to stop.
    """
    if bool(np.all(np.abs(step.motion) < settings.threshold)):
        return "converged"
    if step.chamfer < settings.chamfer:
        return "reached"
    if failures(steps) > settings.holds:
        return "planning_failed"
    if stalled([*(one.chamfer for one in steps), step.chamfer], settings):
        return "stalled"
    if settings.seconds and step.frame.time - start >= settings.seconds:
        return "out_of_time"
    return None


def failures(steps: Sequence[Step]) -> int:
    """Return how many plans failed in a row, up to now."""
    count = 0
    for step in reversed(steps):
        if step.plan is None or step.plan.status != "failed":
            break
        count += 1
    return count


def stalled(chamfers: Sequence[float], settings: ServoSettings) -> bool:
    """Return whether the last motions, as many as there is patience for, came no nearer."""
    if not settings.patience or len(chamfers) <= settings.patience:
        return False
    best = min(chamfers[: -settings.patience])
    return min(chamfers[-settings.patience :]) > best - settings.progress
