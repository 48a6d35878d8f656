"""The arm as a tree of links: one table from which the URDF and the transforms both follow."""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from dnet.geometry.pose import pose, rotation_x, rotation_z
from dnet.sim.psm import HALF, JOINT_NAMES, JOINTS, TIP
from dnet.types import Joints, Pose

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

    def frame(self, joints: Joints) -> Pose:
        """Return the child link in the parent link, (4, 4)."""
        position = self.position(joints)
        if self.kind == "fixed":
            return self.origin
        if self.kind == "prismatic":
            return self.origin @ pose(np.eye(3), np.array([0.0, 0.0, position]))
        return self.origin @ pose(rotation_z(position), np.zeros(3))


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
