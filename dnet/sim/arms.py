"""Two arms around the table: where they stand, how they point at the object, their link frames."""

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from jaxtyping import Float64

from dnet.geometry.pose import pose, quaternions, rotation_x, rotation_z
from dnet.sim.psm import JOINT_NAMES, Psm
from dnet.sim.psm_links import LINK_JOINTS, MOVING, link_poses
from dnet.types import ARMS, JointPath, Joints, LinkWay, Point, Pose, Transform

HOME: Joints = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.0])
"""Joint positions to start a search from: the tool straight down, half inserted."""


@dataclass(frozen=True)
class Placement:
    """Where the arms stand, mirrored about the plane x = 0.

    Chosen so that every point within 6 cm of the grasps is within limits and clear of the other
    arm, the table and the camera stand.
    """

    distance: float = 0.12
    """Of each remote centre of motion from the plane between the arms, in metres."""
    height: float = 0.19
    """Of each remote centre of motion above the table, in metres."""
    tilt: float = 0.1745
    """How far each arm leans outwards, in radians."""
    grasp: tuple[float, float] = (0.045, 0.04)
    """The point that each tool's fixed orientation aims at: distance from the plane between
    the arms and height above the table, in metres."""

    @cached_property
    def arms(self) -> tuple[Psm, Psm]:
        """The holding and the moving arm."""
        return (Psm(self._base(-1.0)), Psm(self._base(1.0)))

    def tool_pose(self, arm: int, tip: Point) -> Pose:
        """Return the pose of a tool whose tip is at `tip`.

        The orientation is the same wherever the tip is: the jaws point along the line from the
        remote centre of motion to the nominal grasp, and open across it.
        """
        side = (-1.0, 1.0)[arm]
        distance, height = self.grasp
        base = self._base(side)
        along = np.array([side * distance, 0.0, height]) - base[:3, 3]
        along /= np.linalg.norm(along)
        across = np.cross([0.0, side, 0.0], along)
        across /= np.linalg.norm(across)
        return pose(np.column_stack([across, np.cross(along, across), along]), tip)

    def joints_at(self, arm: int, tip: Point, *, near: Joints = HOME) -> Joints:
        """Return the joint positions of an arm whose tool tip is at `tip`.

        Raises:
            Unreachable: If the arm cannot reach it.
        """
        return self.arms[arm].inverse(self.tool_pose(arm, tip), near=near)

    def _base(self, side: float) -> Pose:
        turn = rotation_z(side * np.pi / 2) @ rotation_x(self.tilt)
        return pose(turn, np.array([side * self.distance, 0.0, self.height]))


@dataclass(frozen=True)
class ArmModel:
    """The link frames of both arms, as logs and viewers want them."""

    placement: Placement

    joint_names: tuple[str, ...] = JOINT_NAMES

    def transforms(self, joints: tuple[Joints, Joints]) -> list[Transform]:
        """Return every link of both arms in its parent, the bases in `world`.

        A link's name is the arm's, a slash, and the link's name in the URDF.
        """
        names, (translations,), (rotations,) = self.links(joints)
        poses = zip(names, translations, rotations, strict=True)
        return [Transform(*pair, place, turn) for pair, place, turn in poses]

    def links(self, joints: tuple[Joints, Joints]) -> LinkWay:
        """Return the same as `transforms`, at this one time."""
        places, turns = link_poses(np.stack(joints))
        base_places, base_turns = self._bases
        return LinkWay(
            _names(),
            np.concatenate([base_places, places], axis=1).reshape(1, -1, 3),
            np.concatenate([base_turns, turns], axis=1).reshape(1, -1, 4),
        )

    def way(self, path: JointPath) -> LinkWay:
        """Return those links of the moving arm that move, at every row of a joint path."""
        translations, rotations = link_poses(path)
        moving = list(MOVING)
        names = _names()[-len(LINK_JOINTS) :]
        return LinkWay(
            [names[number] for number in moving], translations[:, moving], rotations[:, moving]
        )

    def tips(self, path: JointPath) -> Float64[np.ndarray, "_ 3"]:
        """Return where the moving arm's jaws meet at every row of a joint path, in the world."""
        return self.placement.arms[1].forward_along(path)[:, :3, 3]

    @cached_property
    def _bases(self) -> tuple[Float64[np.ndarray, "2 1 3"], Float64[np.ndarray, "2 1 4"]]:
        bases = np.stack([arm.base for arm in self.placement.arms])
        return bases[:, None, :3, 3], quaternions(bases[:, :3, :3])[:, None]


@cache
def _names() -> list[tuple[str, str]]:
    """Return parent and child of every link of both arms."""
    names: list[tuple[str, str]] = []
    for arm in ARMS:
        names.append(("world", f"{arm}/base_link"))
        names += [(f"{arm}/{link.parent}", f"{arm}/{link.child}") for link in LINK_JOINTS]
    return names
