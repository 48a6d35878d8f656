"""Shape servoing: observe, predict, plan, execute, until the goal shape is reached.

The loop of section II of the paper (Thach, Kuntz and Hermans, DeformerNet, 2021).
"""

import errno
from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from dnet.errors import NoSpace, ShortCloud
from dnet.geometry.chamfer_to import ChamferTo
from dnet.servo.controllers import Controller
from dnet.servo.verdict import ServoSettings, verdict
from dnet.sim.world import Settling
from dnet.types import Frame, Goal, JointPath, Joints, Latency, Outcome, Plan, Point, Step, Trace


@runtime_checkable
class Scene(Protocol):
    """The object and the arms, as far as the loop acts on them."""

    def follow(self, path: JointPath, times: Float64[np.ndarray, "_"]) -> None:
        """Drive the moving arm along a timed joint path."""

    def settle(self) -> Settling:
        """Let the object come to rest, and say what became of it."""
        ...

    def slip(self) -> float:
        """Return how far what the moving arm grasped is from between its jaws, in metres."""
        ...


@runtime_checkable
class Planner(Protocol):
    """Plans motions of the moving arm."""

    def plan(
        self, joints: tuple[Joints, Joints], displacement: Point, *, seed: int, waypoints: int = 0
    ) -> Plan:
        """Return how to move the tip by `displacement` from where both arms stand."""
        ...


@runtime_checkable
class Witness(Protocol):
    """Who is told of a run while it goes on."""

    def add(self, index: int, step: Step) -> None:
        """Take note of a turn, before its plan is executed.

        Raises:
            NoSpace: If there is no room to write it down: the run ends.
        """
        ...

    def timed(self, index: int, step: Step) -> None:
        """Take note of how long a turn took, after it."""
        ...


@dataclass(frozen=True)
class Surroundings:
    """What the loop is wired to."""

    scene: Scene
    """What is acted on."""
    look: Callable[[], Frame]
    """Returns what is seen now; raises ShortCloud if that is too little of the object."""
    controller: Controller
    """Says where the gripper should go."""
    planner: Planner
    """Says how it gets there."""
    witness: Witness
    """Is told of each turn."""
    regrasp: Callable[[], str] | None = None
    """Lets go of the object and grasps it elsewhere; returns why it could not, if so."""
    stop: Callable[[], bool] = bool
    """Whether somebody wants the run to end; asked between the stages of a turn."""


def servo(around: Surroundings, goal: Goal, *, settings: ServoSettings, seed: int) -> Trace:
    """Drive the object to the goal shape and return what happened.

    However it ends, the arms stay where the last motion took them, and hold what they hold.

    Args:
        around: What is acted on, and who acts.
        goal: The shape to reach.
        settings: When to stop.
        seed: Of the planner; step k plans with a seed of its own.
    """
    return _Run(around, goal, settings, seed).trace()


class _End(Exception):
    """The run ends here, for a reason that is none of its stop rules."""

    def __init__(self, outcome: Outcome, reason: str, last: Frame | None = None) -> None:
        super().__init__(outcome)
        self.outcome: Outcome = outcome
        self.reason, self.last = reason, last


class _Run:
    """A run in the making."""

    def __init__(
        self, around: Surroundings, goal: Goal, settings: ServoSettings, seed: int
    ) -> None:
        self._around, self._goal, self._settings, self._seed = around, goal, settings, seed
        self._distance = ChamferTo(goal.cloud)
        self._steps: list[Step] = []
        self._grasped = 0
        """The turn at which the present grasp began."""
        self._regrasps = 0
        self._refusal = ""
        """Why the object could not be grasped again."""
        self._motions = 0
        self._start: float | None = None

    def trace(self) -> Trace:
        """Run to the end."""
        last: Frame | None = None
        try:
            outcome, reason = self._go()
        except _End as end:
            outcome, reason, last = end.outcome, end.reason, end.last
        except KeyboardInterrupt:
            outcome, reason = "interrupted", "Ctrl-C"
        except OSError as error:
            if not isinstance(error, NoSpace) and error.errno != errno.ENOSPC:
                raise
            outcome, reason = "disk_full", str(error)
        return Trace(self._goal, tuple(self._steps), outcome, reason, last)

    def _go(self) -> tuple[Outcome, str]:
        while True:
            step = self._observe()
            outcome = verdict(
                self._steps[self._grasped :],
                step,
                start=step.frame.time if self._start is None else self._start,
                settings=self._settings,
            )
            if outcome is None and self._motions >= self._settings.steps:
                outcome = "out_of_steps"
            if outcome is None:
                plan = self._plan(step)
                self._execute(self._record(replace(step, plan=plan)), plan)
                continue
            self._finish(self._record(step))
            if outcome != "stalled" or not self._regrasped():
                return outcome, self._reason(outcome)

    def _observe(self) -> Step:
        clock = perf_counter()
        frame = self._look()
        self._heed(frame)
        slip = self._around.scene.slip()
        if not slip <= self._settings.slip:
            off = f"what was held is {slip * 1e3:.0f} mm off the jaws"
            raise _End("grasp_lost", off if np.isfinite(slip) else "the jaws are open", frame)
        gaps = self._distance.gaps(frame.cloud)
        seen = perf_counter()
        motion = self._around.controller.predict(frame.cloud, self._goal.cloud)
        if not np.isfinite(motion).all():
            why = f"step {len(self._steps)}: the predicted motion is {motion}"
            raise _End("bad_motion", why, frame)
        latency = Latency((seen - clock) * 1e3, (perf_counter() - seen) * 1e3)
        if self._start is None:
            self._start = frame.time
        return Step(frame, gaps.chamfer, motion, latency=latency, gaps=gaps)

    def _look(self) -> Frame:
        """Return what is seen; a camera that drops a frame is asked again."""
        why = ""
        for _ in range(self._settings.looks):
            self._heed()
            try:
                frame = self._around.look()
            except ShortCloud as error:
                why = str(error)
                continue
            if len(frame.cloud):
                return frame
            why = "the cloud is empty"
        raise _End("object_lost", f"{self._settings.looks} images in a row: {why}")

    def _plan(self, step: Step) -> Plan:
        return self._around.planner.plan(
            step.frame.joints,
            step.motion,
            seed=self._seed * 10_000 + len(self._steps),
            waypoints=self._settings.waypoints,
        )

    def _record(self, step: Step) -> Step:
        """Write a turn down before it is executed."""
        plan = 0.0 if step.plan is None else step.plan.milliseconds
        self._steps.append(step)
        clock = perf_counter()
        self._around.witness.add(len(self._steps) - 1, step)
        return _timed(step, plan=plan, log=_since(clock))

    def _execute(self, step: Step, plan: Plan) -> None:
        self._steps[-1] = step
        self._heed()
        clock = perf_counter()
        self._motions += 1
        self._around.scene.follow(plan.path, plan.times)
        settling = self._around.scene.settle()
        self._finish(_timed(step, execute=_since(clock)))
        if not settling.least_volume_ratio > 0:
            ratio = f"a tetrahedron has {settling.least_volume_ratio:.2g} of its volume at rest"
            raise _End("object_crushed", f"step {len(self._steps) - 1}: {ratio}")

    def _finish(self, step: Step) -> None:
        self._steps[-1] = step
        self._around.witness.timed(len(self._steps) - 1, step)

    def _regrasped(self) -> bool:
        """Grasp the object elsewhere, if that is wanted again; return whether it was."""
        if self._around.regrasp is None or self._regrasps >= self._settings.regrasps:
            return False
        self._regrasps += 1
        self._refusal = self._around.regrasp()
        self._grasped = len(self._steps)
        return not self._refusal

    def _heed(self, last: Frame | None = None) -> None:
        if self._around.stop():
            raise _End("interrupted", "asked to stop", last)

    def _reason(self, outcome: Outcome) -> str:
        steps, settings = self._steps, self._settings
        if outcome == "planning_failed":
            reasons = [one.plan.reason for one in steps if one.plan is not None]
            return f"{settings.holds + 1} plans in a row: {reasons[-1]}"
        if outcome == "stalled":
            why = f"{settings.patience} motions brought the object no nearer"
            return f"{why}; {self._refusal}" if self._refusal else why
        return ""


def _since(clock: float) -> float:
    return (perf_counter() - clock) * 1e3


def _timed(step: Step, **stages: float) -> Step:
    return replace(step, latency=replace(step.latency or Latency(0.0, 0.0), **stages))
