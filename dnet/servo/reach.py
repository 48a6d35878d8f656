"""Which points of a cloud the gripper can reach, by the cloud and the workspace alone."""

import numpy as np
from jaxtyping import Bool, Float64
from scipy.spatial import cKDTree

from dnet.geometry.camera import Camera
from dnet.sim.scenes import Workspace
from dnet.types import Cloud, Point

NEIGHBOURS = 16
"""Points that a normal is fitted to: at 2048 points on an object of 0.1 m, those within 5 mm."""


def reachable(
    cloud: Cloud, workspace: Workspace, *, eye: Point | None = None
) -> Bool[np.ndarray, "_"]:
    """Return which points face the moving arm and leave the holding arm its room.

    Scenes are drawn from the same part of the surface, in the object's own frame; here the
    object's turn about the vertical is not known, and taken to be none.

    Args:
        cloud: An object at rest, in the world, (n, 3).
        workspace: Where the moving arm comes from, and how much room the holding arm takes at
            the end of the object at least x.
        eye: Where the camera stands, that of the laboratory unless given.
    """
    seen_from = np.array(Camera().eye) if eye is None else eye
    faces = normals(cloud, seen_from) @ np.array(workspace.toward) >= workspace.facing
    return faces & (cloud[:, 0] >= cloud[:, 0].min() + workspace.clearance)


def normals(cloud: Cloud, eye: Point) -> Float64[np.ndarray, "n 3"]:
    """Return unit normals of a visible surface, towards the camera that sees it.

    Each is that of the plane nearest to the neighbours of a point (Hoppe et al. 1992).
    """
    points = cloud.astype(np.float64)
    _, rows = cKDTree(points).query(points, k=min(NEIGHBOURS, len(points)))
    near = points[np.asarray(rows).reshape(len(points), -1)]
    spread = near - near.mean(axis=1, keepdims=True)
    _, axes = np.linalg.eigh(spread.transpose(0, 2, 1) @ spread)
    found = axes[:, :, 0]
    return found * np.where(((eye - points) * found).sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
