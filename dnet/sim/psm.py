"""The da Vinci patient-side manipulator: forward and closed-form inverse kinematics.

Modified Denavit-Hartenberg parameters, limits and the tool (large needle driver, 400006) as the
da Vinci Research Kit publishes them for the Classic generation: sawIntuitiveResearchKit,
share/kinematic/PSM*.json and share/tool. The base frame stands at the remote centre of motion,
the point that stays still where the instrument enters the body; z is up, the arm's body lies
on -y.
"""

from dataclasses import dataclass
from functools import cached_property
from math import atan2, pi, sqrt
from typing import Literal

import numpy as np

from dnet.errors import Unreachable
from dnet.geometry.pose import inverse, pose, rotation_x, rotation_z
from dnet.types import Joints, Pose

HALF = pi / 2


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

    def frame(self, position: float) -> Pose:
        """The joint's frame in the frame before it, at `position`."""
        if self.kind == "revolute":
            return self.origin @ pose(rotation_z(position), np.zeros(3))
        return self.origin @ pose(np.eye(3), np.array([0.0, 0.0, position]))


RCM_OFFSET = 0.4318
"""From the insertion joint's zero to the remote centre of motion, in metres."""
TOOL_LENGTH = 0.4162
"""From the insertion frame to the wrist-pitch axis, in metres."""
WRIST_LENGTH = 0.0091
"""From the wrist-pitch axis to the wrist-yaw axis, in metres."""
JAW_LENGTH = 0.0102
"""From the wrist-yaw axis to the tip of the jaws, in metres (dvrk_model)."""
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
        matrix = self.base
        for joint, position in zip(JOINTS, joints, strict=True):
            matrix = matrix @ joint.frame(float(position))
        return matrix @ TIP

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
        local = inverse(self.base) @ tip
        joints = _solve(local, tip)
        turns = joints[3] + 2 * pi * np.array([-1.0, 0.0, 1.0])
        allowed = turns[(turns >= LOWER[3]) & (turns <= UPPER[3])]
        if len(allowed):
            joints[3] = allowed[np.argmin(np.abs(allowed - near[3]))]
        for joint, position in zip(JOINTS, joints, strict=True):
            if not joint.lower - 1e-9 <= position <= joint.upper + 1e-9:
                raise Unreachable(
                    "tool pose",
                    _point(tip),
                    f"{joint.name} would be {position:.3f}, "
                    f"limits {joint.lower:.3f} to {joint.upper:.3f}",
                )
        return joints


def _solve(local: Pose, tip: Pose) -> Joints:
    """Return the joint positions for a tip pose in the base frame, limits aside."""
    wrist = local @ inverse(TIP)
    yaw_axis = wrist[:3, 2]
    # The wrist-pitch axis lies WRIST_LENGTH behind the wrist-yaw axis, towards the base.
    flat = wrist[:3, 3] - (wrist[:3, 3] @ yaw_axis) * yaw_axis
    length = sqrt(flat @ flat)
    if length < 1e-9:
        raise Unreachable("tool pose", _point(tip), "the wrist-yaw axis runs through the base")
    along = flat / length
    pitch_origin = wrist[:3, 3] - WRIST_LENGTH * along
    depth = sqrt(pitch_origin @ pitch_origin)
    if depth < LEAST_DEPTH:
        raise Unreachable(
            "tool pose",
            _point(tip),
            f"the wrist is {depth * 1e3:.0f} mm from the remote centre of motion, "
            f"must be at least {LEAST_DEPTH * 1e3:.0f} mm",
        )
    shaft = pitch_origin / depth  # (sin q1 cos q2, -sin q2, -cos q1 cos q2)
    pitch = float(np.arcsin(np.clip(-shaft[1], -1.0, 1.0)))
    yaw = atan2(shaft[0], -shaft[2])
    insertion = depth + RCM_OFFSET - TOOL_LENGTH
    before_roll = (
        rotation_x(HALF)
        @ rotation_z(HALF + yaw)
        @ rotation_x(-HALF)
        @ rotation_z(pitch - HALF)
        @ rotation_x(HALF)
    )
    pitch_axis = before_roll.T @ np.cross(along, yaw_axis)
    roll = atan2(-pitch_axis[0], pitch_axis[1])
    before_pitch = before_roll @ rotation_z(roll) @ rotation_x(-HALF)
    direction = before_pitch.T @ along
    wrist_pitch = atan2(direction[1], direction[0]) + HALF
    before_yaw = before_pitch @ rotation_z(wrist_pitch - HALF) @ rotation_x(-HALF)
    direction = before_yaw.T @ wrist[:3, 0]
    wrist_yaw = atan2(direction[1], direction[0]) + HALF
    joints = np.array([yaw, pitch, insertion, roll, wrist_pitch, wrist_yaw])
    joints[4:] = (joints[4:] + pi) % (2 * pi) - pi
    return joints


def _point(tip: Pose) -> tuple[float, float, float]:
    return (float(tip[0, 3]), float(tip[1, 3]), float(tip[2, 3]))
