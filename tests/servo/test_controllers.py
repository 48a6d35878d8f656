"""What is not a network decides by rules that can be checked."""

import numpy as np

from dnet.servo.controllers import Nothing, Oracle
from dnet.servo.loop import Surroundings, servo
from dnet.servo.random_trials import RandomTree
from dnet.servo.verdict import ServoSettings
from dnet.types import Goal, Trace
from tests.servo.slab import SHAPE, TARGET, Notes, Slab

GOAL = Goal((SHAPE + TARGET).astype(np.float32), "test")
LOW, HIGH = np.full(3, -0.05), np.full(3, 0.05)


def explore(seed: int, trials: int) -> Trace:
    slab = Slab()
    tree = RandomTree(lambda: slab.tip, low=LOW, high=HIGH, trials=trials, seed=seed)
    settings = ServoSettings(steps=trials + 1, patience=0)
    around = Surroundings(slab, slab.look, tree, slab, Notes())
    return servo(around, GOAL, settings=settings, seed=0)


def test_nothing_never_moves() -> None:
    slab = Slab()
    around = Surroundings(slab, slab.look, Nothing(), slab, Notes())
    trace = servo(around, GOAL, settings=ServoSettings(), seed=0)
    assert [step.plan for step in trace.steps] == [None]
    assert slab.seeds == []


def test_the_oracle_arrives_in_one_motion() -> None:
    slab = Slab()
    around = Surroundings(slab, slab.look, Oracle(lambda: slab.tip, TARGET), slab, Notes())
    trace = servo(around, GOAL, settings=ServoSettings(), seed=0)
    assert trace.outcome == "converged"
    assert len(trace.steps) == 2
    assert trace.steps[-1].chamfer < 1e-6


def test_random_trials_come_nearer_and_end_at_the_best_of_them() -> None:
    trace = explore(seed=0, trials=30)
    chamfers = [step.chamfer for step in trace.steps]
    assert trace.outcome == "converged"
    assert chamfers[-1] == min(chamfers)
    assert chamfers[-1] < chamfers[0] / 2


def test_no_trial_reaches_farther_than_a_branch() -> None:
    trace = explore(seed=1, trials=12)
    tips = [step.frame.grasp for step in trace.steps]
    for number, tip in enumerate(tips[1:], start=1):
        nearest = min(float(np.linalg.norm(tip - other)) for other in tips[:number])
        assert nearest <= 0.02 + 1e-9


def test_the_seed_decides_what_is_tried() -> None:
    one, same, other = (explore(seed=seed, trials=5) for seed in (3, 3, 4))
    tips = [[step.frame.grasp for step in trace.steps] for trace in (one, same, other)]
    np.testing.assert_array_equal(tips[0], tips[1])
    assert not np.array_equal(tips[0][1], tips[2][1])
