"""Time along a joint path: as fast as velocity, acceleration and tip speed allow."""

from itertools import pairwise

import numpy as np
from jaxtyping import Float64

from dnet.planning.arm import METRES_PER_UNIT, Arm
from dnet.types import JointPath

Times = Float64[np.ndarray, "_"]

TIP_SPEED = 0.2
"""In m/s: what soft tissue follows without ringing."""
SAMPLING = 0.02
"""Between two samples of the timed path, in seconds."""
CORNER = np.cos(np.radians(10.0))
"""Cosine of the sharpest turn that is taken without stopping."""


def timed(arm: Arm, path: JointPath) -> tuple[JointPath, Times]:
    """Return the path with a time for each position, at rest at its ends.

    Between sharp corners, where the arm stops, the speed along the polyline is a trapezoid over
    time (Lynch and Park, Modern Robotics, section 9.2.2.2). The path is only resampled, never
    rounded, so what was checked for collisions stays checked.

    Args:
        arm: Whose limits hold.
        path: Joint positions, (n, 6), n >= 1.

    Returns:
        Joint positions, (m, 6), and seconds from the start, (m,), strictly increasing.
    """
    moved = np.linalg.norm(np.diff(path, axis=0) * METRES_PER_UNIT, axis=1) > 1e-9
    path = path[np.concatenate([[True], moved])]
    if len(path) == 1:
        return path, np.zeros(1)
    positions, times = [path[:1]], [np.zeros(1)]
    stops = _corners(path)
    for first, last in pairwise(stops):
        leg, clock = _leg(arm, path[first : last + 1])
        positions.append(leg[1:])
        times.append(times[-1][-1] + clock[1:])
    return np.concatenate(positions), np.concatenate(times)


def _corners(path: JointPath) -> list[int]:
    """Return where the arm must stop: both ends, and wherever the path turns sharply."""
    legs = np.diff(path, axis=0) * METRES_PER_UNIT
    legs = legs / np.linalg.norm(legs, axis=1, keepdims=True)
    turns = (legs[1:] * legs[:-1]).sum(axis=1) < CORNER
    return [0, *(np.flatnonzero(turns) + 1).tolist(), len(path) - 1]


def _leg(arm: Arm, path: JointPath) -> tuple[JointPath, Times]:
    """Return one leg from rest to rest, sampled, with its waypoints among the samples."""
    steps = np.diff(path, axis=0)
    lengths = np.linalg.norm(steps * METRES_PER_UNIT, axis=1)
    reached = np.concatenate([[0.0], np.cumsum(lengths)])
    slope = np.abs(steps / lengths[:, None]).max(axis=0) + 1e-12
    speed = min(TIP_SPEED, float((arm.velocity / slope).min()))
    acceleration = float((arm.acceleration / slope).min())
    total = float(reached[-1])
    speed = min(speed, float(np.sqrt(total * acceleration)))
    ramp = speed / acceleration
    duration = total / speed + ramp

    grid = np.linspace(0.0, duration, max(2, int(np.ceil(duration / SAMPLING)) + 1))
    waypoints = _time_at(reached[1:-1], total, speed, acceleration, duration)
    times = np.unique(np.concatenate([grid, waypoints]))
    times = times[np.concatenate([[True], np.diff(times) > 1e-6])]
    times[-1] = duration
    along = _distance_at(times, total, speed, acceleration, duration)
    columns = [np.interp(along, reached, path[:, joint]) for joint in range(path.shape[1])]
    sampled = np.column_stack(columns)
    sampled[0], sampled[-1] = path[0], path[-1]
    return sampled, times


def _distance_at(
    times: Times, total: float, speed: float, acceleration: float, duration: float
) -> Times:
    ramp = speed / acceleration
    left = duration - times
    cruising = speed * (times - ramp / 2)
    distance = np.where(times < ramp, acceleration * times**2 / 2, cruising)
    return np.where(left < ramp, total - acceleration * left**2 / 2, distance)


def _time_at(
    distance: Times, total: float, speed: float, acceleration: float, duration: float
) -> Times:
    ramp = speed / acceleration
    ramped = speed * ramp / 2
    times = np.where(
        distance < ramped,
        np.sqrt(2 * distance / acceleration),
        distance / speed + ramp / 2,
    )
    left = np.maximum(total - distance, 0.0)
    return np.where(left < ramped, duration - np.sqrt(2 * left / acceleration), times)
