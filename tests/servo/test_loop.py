"""The loop ends when it should, for the reason it gives, and records every step."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from dnet.errors import BadMotion
from dnet.servo.loop import ServoSettings, servo
from dnet.types import Cloud, Frame, Goal, JointPath, Joints, Plan, Point, Step, Trace

SHAPE = np.random.default_rng(0).uniform(-0.05, 0.05, (256, 3)).astype(np.float32)
TARGET = np.array([0.03, -0.02, 0.01])


@dataclass
class Slab:
    """An honest fake of object, arm and planner: a rigid cloud that goes where the tip goes.

    The first three joints are the tip's coordinates.
    """

    tip: Point = field(default_factory=lambda: np.zeros(3))
    time: float = 0.0
    blocked: bool = False
    seeds: list[int] = field(default_factory=list)

    def look(self) -> Frame:
        cloud = (SHAPE + self.tip).astype(np.float32)
        joints = np.concatenate([self.tip, np.zeros(3)])
        return Frame(self.time, "shape", cloud, self.tip.copy(), (np.zeros(6), joints), cloud)

    def follow(self, path: JointPath, times: np.ndarray) -> None:
        self.tip = path[-1, :3].copy()
        self.time += float(times[-1])

    def settle(self) -> None:
        self.time += 0.1

    def plan(self, joints: tuple[Joints, Joints], displacement: Point, *, seed: int) -> Plan:
        self.seeds.append(seed)
        start = joints[1]
        if self.blocked:
            return Plan(
                "failed", start[None], np.zeros(1), displacement, np.zeros(3), "a wall", 1, 0.0
            )
        end = start + np.concatenate([displacement, np.zeros(3)])
        return Plan(
            "straight",
            np.array([start, end]),
            np.array([0.0, 0.5]),
            displacement,
            displacement,
            "",
            1,
            0.0,
        )


class Share:
    """A controller that sees the true displacement of the means and asks for a share of it."""

    def __init__(self, share: float) -> None:
        self.share = share

    def predict(self, current: Cloud, goal: Cloud) -> Point:
        return self.share * (goal.astype(float) - current).mean(axis=0)


def run(slab: Slab, share: float, *, steps: int = 12, seed: int = 0) -> tuple[Trace, list[Step]]:
    seen: list[Step] = []

    def watch(index: int, step: Step) -> None:
        assert index == len(seen)
        seen.append(step)

    goal = Goal((SHAPE + TARGET).astype(np.float32), "test")
    trace = servo(
        slab,
        slab.look,
        Share(share),
        slab,
        goal,
        settings=ServoSettings(steps=steps),
        seed=seed,
        watch=watch,
    )
    return trace, seen


def test_a_perfect_controller_arrives_in_one_motion() -> None:
    trace, seen = run(Slab(), 1.0)
    assert trace.outcome == "converged"
    assert [step.plan is not None for step in trace.steps] == [True, False]
    assert trace.steps[0].chamfer > 5e-3
    assert trace.steps[-1].chamfer < 1e-6
    assert list(trace.steps) == seen


def test_a_timid_controller_needs_more_and_gets_nearer_each_time() -> None:
    trace, _ = run(Slab(), 0.5)
    chamfers = [step.chamfer for step in trace.steps]
    assert trace.outcome == "converged"
    assert chamfers == sorted(chamfers, reverse=True)
    assert np.all(np.abs(trace.steps[-1].motion) < 0.002)
    assert np.abs(trace.steps[-2].motion).max() >= 0.002


def test_steps_run_out_and_the_last_look_is_recorded() -> None:
    trace, _ = run(Slab(), 0.1, steps=3)
    assert trace.outcome == "out_of_steps"
    assert [step.plan is not None for step in trace.steps] == [True, True, True, False]
    assert trace.steps[-1].frame.time > trace.steps[-2].frame.time


def test_a_goal_that_is_there_already_needs_no_motion() -> None:
    slab = Slab(tip=TARGET.copy())
    trace, _ = run(slab, 1.0)
    assert trace.outcome == "converged"
    assert len(trace.steps) == 1
    assert slab.seeds == []


def test_plans_that_keep_failing_end_the_run() -> None:
    trace, _ = run(Slab(blocked=True), 1.0)
    assert trace.outcome == "planning_failed"
    assert [step.plan.status for step in trace.steps if step.plan] == ["failed"] * 3


def test_every_step_plans_with_a_seed_of_its_own_that_the_run_decides() -> None:
    slab, other = Slab(), Slab()
    run(slab, 0.1, steps=4, seed=1)
    run(other, 0.1, steps=4, seed=2)
    assert len(set(slab.seeds)) == 4
    assert not set(slab.seeds) & set(other.seeds)


def test_a_motion_that_is_no_number_is_refused() -> None:
    with pytest.raises(BadMotion, match="step 0: the predicted motion is"):
        run(Slab(), float("nan"))


def test_an_interrupted_run_keeps_the_steps_it_took() -> None:
    class Impatient(Slab):
        def settle(self) -> None:
            super().settle()
            if self.time > 1.0:
                raise KeyboardInterrupt

    trace, seen = run(Impatient(), 0.3)
    assert trace.outcome == "interrupted"
    assert len(trace.steps) == len(seen) == 2
