"""The start of an episode: where a scene puts the object and the arms, and what they grip."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Int64

from dnet.errors import EmptyGrasp
from dnet.geometry.pose import inverse, rotation_z
from dnet.sim.arms import Placement
from dnet.sim.tetrahedra import TetrahedralMesh, Vertices
from dnet.sim.tissue import held_nodes, tissue_mesh
from dnet.types import Joints, Point, Scene

JAW_RADIUS = 0.016
"""Nodes this near to the tip are between the jaws, in metres."""


@dataclass(frozen=True, eq=False)
class Grasp:
    """An object at rest with both arms on it."""

    joints: tuple[Joints, Joints]
    """Of the holding and the moving arm."""
    mesh: TetrahedralMesh
    """The object in its own frame."""
    rest: Vertices
    """Its nodes as it lies on the table, in metres, (n, 3)."""
    held: Int64[np.ndarray, "_"]
    """The nodes that the holding arm grips."""
    gripped: Int64[np.ndarray, "_"]
    """The nodes that the moving arm grips."""

    @property
    def pinned(self) -> Int64[np.ndarray, "_"]:
        """All nodes that an arm grips, those of the holding arm first."""
        return np.concatenate([self.held, self.gripped])


def grasp(scene: Scene, placement: Placement, *, jaw_radius: float = JAW_RADIUS) -> Grasp:
    """Return the object at rest, held and grasped as the scene says.

    Raises:
        Unreachable: If an arm cannot reach its point.
        EmptyGrasp: If no node is within the jaws' radius of the manipulation point.
    """
    point = np.array(scene.manipulation_point)
    joints = (placement.joints_at(0, np.array(scene.hold)), placement.joints_at(1, point))
    mesh = tissue_mesh(scene.tissue)
    rest = mesh.nodes @ rotation_z(scene.yaw).T + np.array([*scene.position, 0.0])
    distance = np.linalg.norm(rest - point, axis=1)
    near = np.flatnonzero(distance < jaw_radius)
    if not len(near):
        raise EmptyGrasp(scene.manipulation_point, float(distance.min()), jaw_radius)
    held = held_nodes(mesh.nodes)
    return Grasp(joints, mesh, rest, held, np.setdiff1d(near, held))


def at(scene: Scene, point: Point) -> Scene:
    """Return the same scene with the object grasped at `point`."""
    x, y, z = point.tolist()
    return replace(scene, manipulation_point=(x, y, z))


def slip(start: Grasp, placement: Placement, *, nodes: Vertices, joints: Joints) -> float:
    """Return how far what was grasped is from where the jaws should have taken it, in metres.

    The mean over the gripped nodes; infinite if none is gripped.

    Args:
        start: The grasp.
        placement: Where the arms stand.
        nodes: Where the nodes are now, (n, 3).
        joints: Of the moving arm now.
    """
    if not len(start.gripped):
        return float("inf")
    arm = placement.arms[1]
    moved = arm.forward(joints) @ inverse(arm.forward(start.joints[1]))
    expected = start.rest[start.gripped] @ moved[:3, :3].T + moved[:3, 3]
    return float(np.linalg.norm(nodes[start.gripped] - expected, axis=1).mean())
