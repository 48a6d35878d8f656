"""What is drawn at random: where the object lies, where it is grasped, how far it is moved."""

from dataclasses import dataclass

import numpy as np

from dnet.errors import NoReachableSurface
from dnet.geometry.pose import rotation_z
from dnet.sim.tissue import hold_point, tissue_mesh
from dnet.types import Point, Scene, Tissue

HIDDEN = 1000
"""Draws on the object's surface after which none of it can be reachable."""


@dataclass(frozen=True)
class Workspace:
    """The ranges that scenes and displacements are drawn from, uniformly."""

    position: float = 0.01
    """Largest offset of the object from the origin along x and along y, in metres."""
    yaw: float = 0.2
    """Largest turn of the object about the vertical, in radians."""
    toward: tuple[float, float, float] = (0.447, 0.0, 0.894)
    """Where the moving arm comes from, seen from the object, as a unit vector."""
    facing: float = 0.3
    """The surface is reachable where its normal has at least this component along `toward`."""
    clearance: float = 0.05
    """Least distance of a manipulation point from the held end of the object, along the object,
    in metres: room for the holding arm."""
    displacement_low: tuple[float, float, float] = (0.0, -0.06, 0.0)
    """Least displacement of the gripper from the manipulation point, in metres. The ranges are
    those of the DeformerNet authors' simulation: pulls along the object by up to 5 cm, 6 cm to
    either side, up to 7 cm high."""
    displacement_high: tuple[float, float, float] = (0.05, 0.06, 0.07)
    """Greatest displacement of the gripper, in metres."""


def draw_scene(workspace: Workspace, tissue: Tissue, random: np.random.Generator) -> Scene:
    """Return a random initial configuration and a random manipulation point on the surface.

    The point is uniform over the part of the surface that the moving arm can reach.
    """
    x, y = random.uniform(-workspace.position, workspace.position, size=2)
    yaw = random.uniform(-workspace.yaw, workspace.yaw)
    turn = rotation_z(yaw)
    toward = turn.T @ np.array(workspace.toward)
    placed = [
        turn @ point + np.array([x, y, 0.0])
        for point in (hold_point(tissue), _draw_surface_point(workspace, tissue, toward, random))
    ]
    hold, manipulation_point = (tuple(point.tolist()) for point in placed)
    return Scene(
        position=(float(x), float(y)),
        yaw=float(yaw),
        hold=hold,
        manipulation_point=manipulation_point,
        tissue=tissue,
    )


def draw_displacement(workspace: Workspace, random: np.random.Generator) -> Point:
    """Return a random displacement of the gripper from the manipulation point, in metres."""
    return random.uniform(workspace.displacement_low, workspace.displacement_high)


def _draw_surface_point(
    workspace: Workspace, tissue: Tissue, toward: Point, random: np.random.Generator
) -> Point:
    """Return a point of the reachable surface, in the object's own frame, (3,)."""
    mesh = tissue_mesh(tissue)
    corners = mesh.nodes[mesh.surface()]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1) / 2
    faces = normals @ toward / (2 * areas) >= workspace.facing
    least = mesh.nodes[:, 0].min() + workspace.clearance
    faces &= corners[:, :, 0].max(axis=1) >= least
    if faces.any():
        corners, areas = corners[faces], areas[faces]
        for _ in range(HIDDEN):
            triangle = corners[random.choice(len(corners), p=areas / areas.sum())]
            weights = random.dirichlet((1.0, 1.0, 1.0))
            point: Point = weights @ triangle
            if point[0] >= least:
                return point
    raise NoReachableSurface(tissue.size, workspace.clearance)
