"""Timed paths keep every limit, stay on the polyline, and start and end at rest."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from dnet.planning.arm import METRES_PER_UNIT
from dnet.planning.timing import TIP_SPEED, timed
from tests.planning.arms import ARM, START

# Waypoints as offsets from the start, in metres of tip motion.
offsets = st.integers(1, 6).flatmap(
    lambda count: hnp.arrays(np.float64, (count, 6), elements=st.floats(-0.03, 0.03))
)


def path_of(offset: np.ndarray) -> np.ndarray:
    return np.vstack([START, START + offset / METRES_PER_UNIT * 0.5])


@settings(deadline=None, max_examples=60)
@given(offset=offsets)
def test_velocities_and_tip_speed_keep_their_limits(offset: np.ndarray) -> None:
    joints, times = timed(ARM, path_of(offset))
    if len(times) == 1:
        return
    assert np.all(np.diff(times) > 0)
    velocity = np.diff(joints, axis=0) / np.diff(times)[:, None]
    assert np.all(np.abs(velocity) <= ARM.velocity * (1 + 1e-6))
    speed = np.linalg.norm(velocity * METRES_PER_UNIT, axis=1)
    assert speed.max() <= TIP_SPEED * (1 + 1e-6)


@settings(deadline=None, max_examples=60)
@given(offset=offsets)
def test_samples_stay_on_the_polyline_and_pass_its_waypoints(offset: np.ndarray) -> None:
    path = path_of(offset)
    joints, _ = timed(ARM, path)
    np.testing.assert_allclose(joints[0], path[0])
    np.testing.assert_allclose(joints[-1], path[-1], atol=1e-9 / METRES_PER_UNIT.min())
    scaled, corners = joints * METRES_PER_UNIT, path * METRES_PER_UNIT
    for point in scaled:
        assert min(_distance(point, a, b) for a, b in pairwise(corners)) < 1e-7
    for corner in corners:
        assert np.linalg.norm(scaled - corner, axis=1).min() < 1e-7


def test_accelerations_keep_their_limits_between_samples() -> None:
    joints, times = timed(ARM, path_of(np.full((1, 6), 0.03)))
    velocity = np.diff(joints, axis=0) / np.diff(times)[:, None]
    middle = (times[1:] + times[:-1]) / 2
    acceleration = np.diff(velocity, axis=0) / np.diff(middle)[:, None]
    assert np.all(np.abs(acceleration) <= ARM.acceleration * (1 + 1e-3))
    # The binding limit is used, not merely kept.
    used = max(
        float((np.abs(acceleration) / ARM.acceleration).max()),
        float((np.abs(velocity) / ARM.velocity).max()),
    )
    assert used > 0.95


@pytest.mark.parametrize("joint", range(6))
def test_a_short_motion_speeds_up_until_its_middle_and_slows_down_from_there(joint: int) -> None:
    move = np.zeros(6)
    move[joint] = 0.001
    joints, times = timed(ARM, np.vstack([START, START + move]))
    # Too short for any limit of speed: half the way at full acceleration, half at full braking.
    fastest = 2 * np.sqrt(move[joint] / ARM.acceleration[joint])
    assert times[-1] == pytest.approx(fastest, rel=1e-6)
    along = np.interp(fastest / 2, times, joints[:, joint]) - START[joint]
    assert along == pytest.approx(move[joint] / 2, rel=1e-6)


def test_a_path_without_motion_takes_no_time() -> None:
    joints, times = timed(ARM, np.array([START, START, START]))
    assert len(joints) == len(times) == 1
    assert times[0] == 0


def _distance(point: np.ndarray, a: np.ndarray, b: np.ndarray) -> float:
    length = float((b - a) @ (b - a))
    share = 0.0 if length == 0 else float(np.clip((point - a) @ (b - a) / length, 0, 1))
    return float(np.linalg.norm(point - a - share * (b - a)))
