"""The end of the object that is held tells whether a goal can be of it."""

import numpy as np
import pytest

from dnet.servo.held_end import LIMIT, held_end_apart
from dnet.types import Cloud

HOLD = (-0.05, 0.0, 0.04)


def lid(*, turned: float = 0.0, bend: float = 0.0) -> Cloud:
    """The top of a box, turned about the grip, its other end bent up."""
    x, y = np.random.default_rng(0).uniform([0.0, -0.05], [0.1, 0.05], (2000, 2)).T
    up = 0.04 + bend * np.maximum(0.0, x - 0.03)
    cos, sin = np.cos(turned), np.sin(turned)
    return np.stack([cos * x - sin * y - 0.05, sin * x + cos * y, up], axis=1).astype(np.float32)


def test_a_goal_that_is_bent_elsewhere_can_be_of_the_object() -> None:
    assert held_end_apart(lid(), lid(), HOLD) == 0
    assert held_end_apart(lid(), lid(bend=1.0), HOLD) < 0.001


def test_a_goal_that_is_elsewhere_cannot() -> None:
    lifted = lid() + np.array([0, 0, 0.02], np.float32)
    assert held_end_apart(lid(), lifted, HOLD) == pytest.approx(0.02, rel=0.01)
    assert held_end_apart(lid(), lid(turned=np.pi), HOLD) > LIMIT


def test_an_end_that_is_not_seen_tells_nothing() -> None:
    assert held_end_apart(lid(), lid() + np.float32(1), (1.0, 0.0, 0.0)) == 0
