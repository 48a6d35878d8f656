"""The loop ends when it should, for the reason it gives, and records every step."""

import errno
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dnet.errors import ShortCloud
from dnet.servo.loop import Surroundings, servo
from dnet.servo.verdict import ServoSettings
from dnet.sim.world import Settling
from dnet.types import Frame, Goal, Joints, Outcome, Plan, Point, Step, Trace
from tests.servo.slab import SHAPE, TARGET, Notes, Share, Slab, without_time

GOAL = Goal((SHAPE + TARGET).astype(np.float32), "test")


def run(
    slab: Slab,
    share: float,
    *,
    seed: int = 0,
    around: dict[str, Any] | None = None,
    **settings: Any,
) -> tuple[Trace, Notes]:
    notes = Notes()
    wired = Surroundings(slab, slab.look, Share(share), slab, notes)
    wired = replace(wired, **(around or {}))
    return servo(wired, GOAL, settings=ServoSettings(**settings), seed=seed), notes


def test_a_perfect_controller_arrives_in_one_motion() -> None:
    trace, notes = run(Slab(), 1.0)
    assert trace.outcome == "converged"
    assert [step.plan is not None for step in trace.steps] == [True, False]
    assert trace.steps[0].chamfer > 5e-3
    assert trace.steps[-1].chamfer < 1e-6
    assert list(trace.steps) == notes.timings
    assert [without_time(step) for step in notes.added] == [
        without_time(step) for step in trace.steps
    ]


def test_a_timid_controller_needs_more_and_gets_nearer_each_time() -> None:
    trace, _ = run(Slab(), 0.5)
    chamfers = [step.chamfer for step in trace.steps]
    assert trace.outcome == "converged"
    assert chamfers == sorted(chamfers, reverse=True)
    assert np.all(np.abs(trace.steps[-1].motion) < 0.002)
    assert np.abs(trace.steps[-2].motion).max() >= 0.002


def test_a_goal_that_is_near_enough_is_reached() -> None:
    trace, _ = run(Slab(), 0.5, chamfer=0.01)
    assert trace.outcome == "reached"
    assert trace.steps[-1].chamfer < 0.01 <= trace.steps[-2].chamfer


def test_steps_run_out_and_the_last_look_is_recorded() -> None:
    trace, _ = run(Slab(), 0.1, steps=3)
    assert trace.outcome == "out_of_steps"
    assert [step.plan is not None for step in trace.steps] == [True, True, True, False]
    assert trace.steps[-1].frame.time > trace.steps[-2].frame.time


def test_time_of_the_simulation_runs_out() -> None:
    trace, _ = run(Slab(time=7.0), 0.1, seconds=1.0)
    assert trace.outcome == "out_of_time"
    assert 8.0 <= trace.steps[-1].frame.time < 8.7


def test_motions_that_bring_the_object_no_nearer_stall() -> None:
    trace, _ = run(Slab(), -0.1, patience=3)
    assert trace.outcome == "stalled"
    assert sum(step.plan is not None for step in trace.steps) == 3
    assert "3 motions brought the object no nearer" in trace.reason


def test_without_patience_nothing_stalls() -> None:
    trace, _ = run(Slab(), -0.1, patience=0, steps=8)
    assert trace.outcome == "out_of_steps"


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
    assert trace.reason == "3 plans in a row: a wall"


def test_every_step_plans_with_a_seed_of_its_own_that_the_run_decides() -> None:
    slab, other = Slab(), Slab()
    run(slab, 0.1, steps=4, seed=1)
    run(other, 0.1, steps=4, seed=2)
    assert len(set(slab.seeds)) == 4
    assert not set(slab.seeds) & set(other.seeds)


def test_the_planner_is_told_how_far_to_go() -> None:
    class Counting(Slab):
        def plan(
            self,
            joints: tuple[Joints, Joints],
            displacement: Point,
            *,
            seed: int,
            waypoints: int = 0,
        ) -> Plan:
            assert waypoints == 7
            return super().plan(joints, displacement, seed=seed)

    assert run(Counting(), 1.0, waypoints=7)[0].outcome == "converged"


def test_every_turn_says_how_long_its_stages_took() -> None:
    trace, _ = run(Slab(), 0.5)
    for step in trace.steps:
        assert step.latency is not None
        assert step.latency.observe > 0
        assert step.latency.predict > 0
        assert step.latency.log > 0
        assert (step.latency.execute > 0) == (step.plan is not None)


def raising(error: BaseException, *, after: int) -> Callable[[Slab], Callable[[], Frame]]:
    """Return what makes a camera that works `after` times and then raises."""

    def make(slab: Slab) -> Callable[[], Frame]:
        looks = 0

        def look() -> Frame:
            nonlocal looks
            looks += 1
            if looks > after:
                raise error
            return slab.look()

        return look

    return make


@pytest.mark.parametrize(
    ("error", "outcome"),
    [
        (ShortCloud(3, 2048), "object_lost"),
        (KeyboardInterrupt(), "interrupted"),
        (OSError(errno.ENOSPC, "No space left on device"), "disk_full"),
    ],
)
@pytest.mark.parametrize("after", [0, 2])
def test_a_fault_has_its_name_and_the_steps_before_it_stay(
    error: BaseException, outcome: Outcome, after: int
) -> None:
    slab = Slab()
    trace, notes = run(slab, 0.3, around={"look": raising(error, after=after)(slab)})
    assert trace.outcome == outcome
    assert trace.reason
    assert len(trace.steps) == len(notes.added) == after


def test_an_empty_cloud_is_an_object_lost() -> None:
    slab = Slab()
    empty = replace(slab.look(), cloud=SHAPE[:0])
    trace, _ = run(slab, 0.3, around={"look": lambda: empty})
    assert trace.outcome == "object_lost"
    assert trace.reason == "3 images in a row: the cloud is empty"


def test_an_image_that_is_lost_is_taken_again() -> None:
    slab, looks = Slab(), 0

    def look() -> Frame:
        nonlocal looks
        looks += 1
        if looks % 3:
            raise ShortCloud(0, 2048)
        return slab.look()

    trace, _ = run(slab, 0.5, around={"look": look})
    assert trace.outcome == "converged"
    assert looks == 3 * len(trace.steps)


def test_a_motion_that_is_no_number_ends_the_run_and_what_was_seen_is_kept() -> None:
    trace, notes = run(Slab(), float("nan"))
    assert trace.outcome == "bad_motion"
    assert trace.reason == "step 0: the predicted motion is [nan nan nan]"
    assert notes.added == []
    assert trace.last is not None
    np.testing.assert_array_equal(trace.last.cloud, SHAPE)


def test_a_grasp_that_slips_is_lost() -> None:
    class Slippery(Slab):
        def settle(self) -> Settling:
            self.slipped += 0.006
            return super().settle()

    trace, _ = run(Slippery(), 0.3)
    assert trace.outcome == "grasp_lost"
    assert trace.reason == "what was held is 12 mm off the jaws"
    assert len(trace.steps) == 2
    assert trace.last is not None


def test_an_object_that_is_turned_inside_out_ends_the_run() -> None:
    class Soft(Slab):
        def settle(self) -> Settling:
            return replace(super().settle(), least_volume_ratio=1.0 - 2 * self.time)

    trace, notes = run(Soft(), 0.3)
    assert trace.outcome == "object_crushed"
    assert trace.reason == "step 0: a tetrahedron has -0.2 of its volume at rest"
    assert len(trace.steps) == len(notes.timings) == 1


def test_an_interrupted_run_keeps_the_steps_it_took() -> None:
    class Impatient(Slab):
        def settle(self) -> Settling:
            settling = super().settle()
            if self.time > 1.0:
                raise KeyboardInterrupt
            return settling

    trace, notes = run(Impatient(), 0.3)
    assert trace.outcome == "interrupted"
    assert len(trace.steps) == len(notes.added) == 2


def test_a_run_that_is_asked_to_stop_executes_nothing_more() -> None:
    slab = Slab()
    trace, notes = run(slab, 0.3, around={"stop": lambda: len(slab.seeds) >= 2})
    assert trace.outcome == "interrupted"
    assert trace.reason == "asked to stop"
    assert len(trace.steps) == len(notes.added) == 2


def test_a_full_disk_ends_the_run() -> None:
    class Full(Notes):
        def add(self, index: int, step: Step) -> None:
            if index == 2:
                raise OSError(errno.ENOSPC, "No space left on device")
            super().add(index, step)

    trace, _ = run(Slab(), 0.3, around={"witness": Full()})
    assert trace.outcome == "disk_full"
    assert "No space left on device" in trace.reason


def test_any_other_error_of_the_system_is_none_of_the_loops_business() -> None:
    slab = Slab()
    look = raising(PermissionError("no"), after=1)(slab)
    with pytest.raises(PermissionError):
        run(slab, 0.3, around={"look": look})


def test_a_run_that_stalls_grasps_elsewhere_as_often_as_it_may() -> None:
    grasped = []

    def regrasp() -> str:
        grasped.append(1)
        return ""

    trace, _ = run(Slab(), -0.1, around={"regrasp": regrasp}, patience=2, regrasps=2, steps=20)
    assert trace.outcome == "stalled"
    assert len(grasped) == 2
    assert sum(step.plan is not None for step in trace.steps) == 6
    assert sum(step.plan is None for step in trace.steps) == 3


def test_a_run_that_cannot_grasp_elsewhere_says_why() -> None:
    trace, _ = run(Slab(), -0.1, around={"regrasp": lambda: "too far"}, patience=2, regrasps=1)
    assert trace.outcome == "stalled"
    assert trace.reason.endswith("no nearer; too far")


def test_the_same_run_twice_is_the_same_but_for_its_timings() -> None:
    (one, _), (two, _) = run(Slab(), 0.3), run(Slab(), 0.3)
    for a, b in zip(one.steps, two.steps, strict=True):
        np.testing.assert_array_equal(a.frame.cloud, b.frame.cloud)
        np.testing.assert_array_equal(a.motion, b.motion)
        assert a.chamfer == b.chamfer
