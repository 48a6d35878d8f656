"""The da Vinci patient-side manipulator: forward and closed-form inverse kinematics.

Modified Denavit-Hartenberg parameters, limits and the tool (large needle driver, 400006) as the
da Vinci Research Kit publishes them for the Classic generation: sawIntuitiveResearchKit,
share/kinematic/PSM*.json and share/tool. The base frame stands at the remote centre of motion,
the point that stays still where the instrument enters the body; z is up, the arm's body lies
on -y.
"""

from dataclasses import dataclass
from functools import cached_property
from math import pi
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float64

from dnet.errors import Unreachable
from dnet.geometry.pose import about_z, inverse, pose, rotation_x, rotation_z, rotations_z
from dnet.types import JointPath, Joints, Pose, Poses

HALF = pi / 2
UP, DOWN = rotation_x(HALF), rotation_x(-HALF)


@dataclass(frozen=True)
class DHJoint:
    """One row of the table: Rx(alpha) Tx(a) Rz(theta) Tz(d), the joint about or along z."""

    name: str
    kind: Literal["revolute", "prismatic"]
    alpha: float
    a: float
    theta: float
    """Angle at joint position zero."""
    d: float
    """Distance along z at joint position zero."""
    lower: float
    upper: float
    velocity: float
    """Limit in rad/s or m/s."""
    acceleration: float
    """Limit in rad/s^2 or m/s^2."""

    @cached_property
    def origin(self) -> Pose:
        """The joint's frame in the frame before it, at position zero."""
        turn = rotation_x(self.alpha)
        offset = np.array([self.a, 0.0, 0.0]) + turn @ np.array([0.0, 0.0, self.d])
        return pose(turn @ rotation_z(self.theta), offset)


RCM_OFFSET = 0.4318
"""From the insertion joint's zero to the remote centre of motion, in metres."""
TOOL_LENGTH = 0.4162
"""From the insertion frame to the wrist-pitch axis, in metres."""
WRIST_LENGTH = 0.0091
"""From the wrist-pitch axis to the wrist-yaw axis, in metres."""
JAW_LENGTH = 0.0102
"""From the wrist-yaw axis to the tip of the jaws, in metres (dvrk_model)."""
LEAST_REACH = 1e-9
"""Distance of the base from the wrist-yaw axis below which its direction is lost, in metres."""
LEAST_DEPTH = 0.045
"""How far the wrist-pitch axis stays below the remote centre of motion, so that the whole wrist
is out of the cannula, in metres."""

# Wrist velocities: the console's file allows 18.8 rad/s; 3 rad/s is what tissue work needs.
JOINTS: tuple[DHJoint, ...] = (
    DHJoint("yaw", "revolute", HALF, 0.0, HALF, 0.0, -1.588, 1.588, 1.5708, 1.5708),
    DHJoint("pitch", "revolute", -HALF, 0.0, -HALF, 0.0, -0.925025, 0.925025, 1.5708, 1.5708),
    DHJoint("insertion", "prismatic", HALF, 0.0, 0.0, -RCM_OFFSET, 0.0, 0.24, 0.2, 0.2),
    DHJoint("roll", "revolute", 0.0, 0.0, 0.0, TOOL_LENGTH, -4.53786, 4.53786, 3.0, 12.566),
    DHJoint("wrist_pitch", "revolute", -HALF, 0.0, -HALF, 0.0, -1.39626, 1.39626, 3.0, 12.566),
    DHJoint(
        "wrist_yaw", "revolute", -HALF, WRIST_LENGTH, -HALF, 0.0, -1.39626, 1.39626, 3.0, 12.566
    ),
)
JOINT_NAMES = tuple(joint.name for joint in JOINTS)
LOWER = np.array([joint.lower for joint in JOINTS])
UPPER = np.array([joint.upper for joint in JOINTS])
VELOCITY = np.array([joint.velocity for joint in JOINTS])
ACCELERATION = np.array([joint.acceleration for joint in JOINTS])

TIP = pose(np.array([[0.0, -1, 0], [0, 0, 1], [-1, 0, 0]]), np.array([0.0, JAW_LENGTH, 0.0]))
"""The tip of the closed jaws in the wrist-yaw frame: z along the jaws."""


ORIGINS = np.stack([joint.origin for joint in JOINTS])
TURNS = np.array([joint.kind == "revolute" for joint in JOINTS], dtype=np.float64)
"""1 for a joint that turns, 0 for one that slides."""


@dataclass(frozen=True, eq=False)
class Psm:
    """One arm, standing somewhere in the world."""

    base: Pose
    """The remote centre of motion in the world, (4, 4)."""

    lower = LOWER
    upper = UPPER
    velocity = VELOCITY
    acceleration = ACCELERATION

    def forward(self, joints: Joints) -> Pose:
        """Return the tip of the jaws in the world, (4, 4)."""
        return self.forward_along(joints[None])[0]

    def forward_along(self, path: JointPath) -> Poses:
        """Return the tip of the jaws in the world at every row of a joint path, (n, 4, 4)."""
        frames = about_z(ORIGINS, angles=path * TURNS, distances=path * (1.0 - TURNS))
        tips = self.base
        for number in range(len(JOINTS)):
            tips = tips @ frames[:, number]
        return tips @ TIP

    def inverse(self, tip: Pose, *, near: Joints) -> Joints:
        """Return the joint positions that bring the tip to a pose, in closed form.

        The wrist's axes meet the shaft one after the other, so every joint follows from
        projections of the pose; the solution is unique but for full turns of the roll, of which
        the one nearest to `near` is taken.

        Args:
            tip: Wanted pose of the tip in the world, (4, 4).
            near: Joint positions to stay close to, (6,).

        Raises:
            Unreachable: If the pose is singular, too near the remote centre of motion, or
                beyond a joint's limit; the message says which.
        """
        path, fault = self.inverse_along(tip[None], near=near)
        if fault is not None:
            raise fault
        return path[0]

    def inverse_along(self, tips: Poses, *, near: Joints) -> tuple[JointPath, Unreachable | None]:
        """Return joint positions for poses of the tip that follow each other, as `inverse` does.

        Each stays close to the one before it. Many together cost hardly more than one.

        Args:
            tips: Wanted poses of the tip in the world, (n, 4, 4).
            near: Joint positions for the first to stay close to, (6,).

        Returns:
            Joint positions up to the first pose that is out of reach, (m, 6), m <= n, and why
            that one is; None if all can be reached.
        """
        solved = _solve(inverse(self.base) @ tips)
        path = solved.joints
        _unwind(path[:, 3], near=float(near[3]))
        beyond = (path < LOWER - 1e-9) | (path > UPPER + 1e-9)
        singular, shallow = solved.reach < LEAST_REACH, solved.depth < LEAST_DEPTH
        wrong = np.flatnonzero(singular | shallow | beyond.any(axis=1))
        if not len(wrong):
            return path, None
        first = int(wrong[0])
        if singular[first]:
            why = "the wrist-yaw axis runs through the base"
        elif shallow[first]:
            why = (
                f"the wrist is {solved.depth[first] * 1e3:.0f} mm from the remote centre of "
                f"motion, must be at least {LEAST_DEPTH * 1e3:.0f} mm"
            )
        else:
            number = int(beyond[first].argmax())
            joint, position = JOINTS[number], path[first, number]
            why = (
                f"{joint.name} would be {position:.3f}, "
                f"limits {joint.lower:.3f} to {joint.upper:.3f}"
            )
        x, y, z = tips[first, :3, 3].tolist()
        return path[:first], Unreachable("tool pose", (x, y, z), why)


def _unwind(rolls: Float64[np.ndarray, "_"], *, near: float) -> None:
    """Turn each roll by full turns to within its limits, as near as can be to the one before."""
    for row, roll in enumerate(rolls.tolist()):
        turns = (roll - 2 * pi, roll, roll + 2 * pi)
        allowed = [turn for turn in turns if LOWER[3] <= turn <= UPPER[3]]
        near = min(allowed, key=lambda turn: abs(turn - near), default=roll)
        rolls[row] = near


class _Solved(NamedTuple):
    """Joint positions for tip poses in the base frame, limits aside."""

    joints: JointPath
    reach: Float64[np.ndarray, "_"]
    """Distance of the base from the wrist-yaw axis, in metres; the pose is singular at 0."""
    depth: Float64[np.ndarray, "_"]
    """Distance of the wrist-pitch axis from the remote centre of motion, in metres."""


def _solve(local: Poses) -> _Solved:
    wrist = local @ inverse(TIP)
    yaw_axis, origin = wrist[:, :3, 2], wrist[:, :3, 3]
    # The wrist-pitch axis lies WRIST_LENGTH behind the wrist-yaw axis, towards the base.
    flat = origin - (origin * yaw_axis).sum(axis=1, keepdims=True) * yaw_axis
    reach = np.linalg.norm(flat, axis=1)
    along = flat / np.maximum(reach, LEAST_REACH)[:, None]
    pitch_origin = origin - WRIST_LENGTH * along
    depth = np.linalg.norm(pitch_origin, axis=1)
    # (sin q1 cos q2, -sin q2, -cos q1 cos q2)
    shaft = pitch_origin / np.maximum(depth, LEAST_REACH)[:, None]
    pitch = np.arcsin(np.clip(-shaft[:, 1], -1.0, 1.0))
    yaw = np.arctan2(shaft[:, 0], -shaft[:, 2])
    insertion = depth + RCM_OFFSET - TOOL_LENGTH
    before_roll = UP @ rotations_z(HALF + yaw) @ DOWN @ rotations_z(pitch - HALF) @ UP
    pitch_axis = _seen_from(before_roll, np.cross(along, yaw_axis))
    roll = np.arctan2(-pitch_axis[:, 0], pitch_axis[:, 1])
    before_pitch = before_roll @ rotations_z(roll) @ DOWN
    direction = _seen_from(before_pitch, along)
    wrist_pitch = np.arctan2(direction[:, 1], direction[:, 0]) + HALF
    before_yaw = before_pitch @ rotations_z(wrist_pitch - HALF) @ DOWN
    direction = _seen_from(before_yaw, wrist[:, :3, 0])
    wrist_yaw = np.arctan2(direction[:, 1], direction[:, 0]) + HALF
    joints = np.column_stack([yaw, pitch, insertion, roll, wrist_pitch, wrist_yaw])
    joints[:, 4:] = (joints[:, 4:] + pi) % (2 * pi) - pi
    return _Solved(joints, reach, depth)


def _seen_from(
    rotations: Float64[np.ndarray, "n 3 3"], vectors: Float64[np.ndarray, "n 3"]
) -> Float64[np.ndarray, "n 3"]:
    """Return vectors of one frame in frames that are turned in it."""
    return np.einsum("nij,ni->nj", rotations, vectors)
