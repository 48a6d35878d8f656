"""Shape servoing: observe, predict, plan, execute, until the goal shape is reached.

The loop of section II of the paper (Thach, Kuntz and Hermans, DeformerNet, 2021).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from dnet.errors import BadMotion
from dnet.geometry.chamfer import chamfer
from dnet.servo.controllers import Controller
from dnet.types import Frame, Goal, JointPath, Joints, Outcome, Plan, Point, Step, Trace


@runtime_checkable
class Scene(Protocol):
    """The object and the arms, as far as the loop acts on them."""

    def follow(self, path: JointPath, times: Float64[np.ndarray, "_"]) -> None:
        """Drive the moving arm along a timed joint path."""

    def settle(self) -> object:
        """Let the object come to rest."""


@runtime_checkable
class Planner(Protocol):
    """Plans motions of the moving arm."""

    def plan(self, joints: tuple[Joints, Joints], displacement: Point, *, seed: int) -> Plan:
        """Return how to move the tip by `displacement` from where both arms stand."""
        ...


@dataclass(frozen=True)
class ServoSettings:
    """When a run ends."""

    steps: int = 12
    """Motions after which it gives up."""
    threshold: float = 0.002
    """The goal counts as reached when the predicted motion is below this on every axis, in
    metres."""
    holds: int = 2
    """Plans in a row that may fail before the run does."""


def servo(
    scene: Scene,
    look: Callable[[], Frame],
    controller: Controller,
    planner: Planner,
    goal: Goal,
    *,
    settings: ServoSettings,
    seed: int,
    watch: Callable[[int, Step], None],
) -> Trace:
    """Drive the object to the goal shape and return what happened.

    Args:
        scene: What is acted on.
        look: Returns what is seen now.
        controller: Says where the gripper should go.
        planner: Says how it gets there.
        goal: The shape to reach.
        settings: When to stop.
        seed: Of the planner; step k plans with a seed of its own.
        watch: Called with each step before it is executed, and with the last.

    Raises:
        BadMotion: If the controller asks for a motion that is not a number.
    """
    steps: list[Step] = []
    failures = 0

    def observe() -> Step:
        frame = look()
        motion = controller.predict(frame.cloud, goal.cloud)
        if not np.isfinite(motion).all():
            raise BadMotion(motion, len(steps))
        return Step(frame, chamfer(frame.cloud, goal.cloud), motion)

    def record(step: Step) -> None:
        steps.append(step)
        watch(len(steps) - 1, step)

    outcome: Outcome | None = None
    try:
        step = observe()
        while (outcome := _verdict(step, len(steps), failures, settings)) is None:
            plan = planner.plan(step.frame.joints, step.motion, seed=seed * 10_000 + len(steps))
            record(replace(step, plan=plan))
            failures = failures + 1 if plan.status == "failed" else 0
            scene.follow(plan.path, plan.times)
            scene.settle()
            step = observe()
        record(step)
    except KeyboardInterrupt:
        outcome = "interrupted"
    return Trace(goal, tuple(steps), outcome)


def _verdict(step: Step, turns: int, failures: int, settings: ServoSettings) -> Outcome | None:
    """Return how the run has ended, or None if it goes on."""
    if bool(np.all(np.abs(step.motion) < settings.threshold)):
        return "converged"
    if failures > settings.holds:
        return "planning_failed"
    if turns >= settings.steps:
        return "out_of_steps"
    return None
