"""The arm as a tree of links: one table from which the URDF and the transforms both follow."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float64

from dnet.geometry.pose import about_z, pose, quaternions, rotation_x, rotation_z
from dnet.sim.psm import HALF, JOINT_NAMES, JOINTS, TIP
from dnet.types import JointPath, Joints, Pose

PIVOT_DISTANCE = 0.5185
"""From the remote centre of motion to the parallelogram's pivot along the yaw axis, in metres."""
PARALLELOGRAM_HEIGHT = 0.150
"""Between the parallelogram's two long bars, in metres (Classic)."""
PARALLELOGRAM_OFFSET = 0.040
"""From the instrument's shaft to the bar's far end, in metres (Classic)."""
BACK_OFFSET = PARALLELOGRAM_OFFSET + 0.0018
"""From the yaw axis to the back link's upper end, in metres."""
JAW_ANGLE = 0.15
"""How far each jaw stands open on the tissue between them."""


@dataclass(frozen=True, eq=False)
class LinkJoint:
    """How one link hangs on another."""

    name: str
    kind: Literal["revolute", "prismatic", "fixed"]
    parent: str
    child: str
    origin: Pose
    """The joint at position zero, in the parent link's frame."""
    follows: str | None = None
    """The joint of the kinematic chain whose position this one takes; None where it rests."""
    sign: float = 1.0
    """How it takes that position."""
    rest: float = 0.0
    """Its position where it follows none."""
    limits: tuple[float, float] = (0.0, 0.0)

    def position(self, joints: Joints) -> float:
        """Return this joint's position when the chain stands at `joints`."""
        if self.follows is None:
            return self.rest
        return self.sign * float(joints[JOINT_NAMES.index(self.follows)])


def _chain() -> tuple[LinkJoint, ...]:
    parents = ("base", *JOINT_NAMES)
    return tuple(
        LinkJoint(
            joint.name,
            joint.kind,
            f"{parent}_link",
            f"{joint.name}_link",
            joint.origin,
            follows=joint.name,
            limits=(joint.lower, joint.upper),
        )
        for parent, joint in zip(parents, JOINTS, strict=False)
    )


def _jaw(side: str, turn: Pose) -> LinkJoint:
    return LinkJoint(
        f"jaw_{side}",
        "revolute",
        "wrist_yaw_link",
        f"jaw_{side}_link",
        turn,
        rest=JAW_ANGLE,
        limits=(-0.35, 0.70),
    )


LINK_JOINTS: tuple[LinkJoint, ...] = (
    *_chain(),
    _jaw("left", np.eye(4)),
    # The right jaw opens the other way: its axis is turned over.
    _jaw("right", pose(rotation_x(np.pi), np.zeros(3))),
    LinkJoint("tip", "fixed", "wrist_yaw_link", "tip_link", TIP),
    LinkJoint(
        "pitch_back",
        "revolute",
        "yaw_link",
        "back_link",
        pose(rotation_x(-HALF) @ rotation_z(-HALF), np.array([0.0, 0.0, PIVOT_DISTANCE])),
        follows="pitch",
        limits=(-1.6, 1.6),
    ),
    LinkJoint(
        "pitch_bar",
        "revolute",
        "back_link",
        "bar_link",
        pose(np.eye(3), np.array([BACK_OFFSET, PARALLELOGRAM_HEIGHT, 0.0])),
        follows="pitch",
        sign=-1.0,
        limits=(-1.6, 1.6),
    ),
)
"""Every joint of the URDF, parents before children; the last two close the parallelogram."""

_ORIGINS = np.stack([link.origin for link in LINK_JOINTS])
_TURNS = np.array([link.kind == "revolute" for link in LINK_JOINTS], dtype=np.float64)
_RESTS = np.array([link.rest for link in LINK_JOINTS])
_SIGNS = np.zeros((len(JOINT_NAMES), len(LINK_JOINTS)))
for _column, _link in enumerate(LINK_JOINTS):
    if _link.follows is not None:
        _SIGNS[JOINT_NAMES.index(_link.follows), _column] = _link.sign


MOVING = tuple(number for number, link in enumerate(LINK_JOINTS) if link.follows is not None)
"""Which of the joints move when the arm does."""
_QUATERNIONS = quaternions(_ORIGINS[:, :3, :3])


def link_frames(path: JointPath) -> Float64[np.ndarray, "n links 4 4"]:
    """Return every link in its parent at every row of a joint path, in the order of the joints."""
    positions = path @ _SIGNS + _RESTS
    return about_z(_ORIGINS, angles=positions * _TURNS, distances=positions * (1.0 - _TURNS))


def link_poses(
    path: JointPath,
) -> tuple[Float64[np.ndarray, "n links 3"], Float64[np.ndarray, "n links 4"]]:
    """Return the same as translations and unit quaternions x y z w, w >= 0."""
    positions = path @ _SIGNS + _RESTS
    slides = positions * (1.0 - _TURNS)
    translations = _ORIGINS[:, :3, 3] + slides[..., None] * _ORIGINS[:, :3, 2]
    half = positions * _TURNS / 2
    c, s = np.cos(half), np.sin(half)
    # The joint's own quaternion, then a turn about z.
    x, y, z, w = _QUATERNIONS.T
    turned = np.stack([x * c + y * s, y * c - x * s, z * c + w * s, w * c - z * s], axis=-1)
    return translations, np.where(turned[..., 3:] < 0, -turned, turned)
