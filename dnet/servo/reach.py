"""Which points of a cloud the gripper can reach, by the cloud and the workspace alone."""

import numpy as np
from jaxtyping import Bool, Float32
from scipy.spatial import cKDTree

from dnet.geometry.camera import Camera
from dnet.geometry.hidden_sides import AROUND, HEIGHTS, hidden_sides, side_normals
from dnet.geometry.normals import normals
from dnet.sim.scenes import Workspace
from dnet.types import Cloud, Point

SEEN = 0.004
"""Distance to the cloud up to which a point of a side is seen, in metres."""


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


def reachable_hidden_sides(cloud: Cloud, workspace: Workspace) -> Float32[np.ndarray, "sides 3"]:
    """Return points of the sides that the camera does not see and the gripper can reach.

    Of the walls of `hidden_sides` every second step around, which is about as far apart as 200
    keypoints of an object of 0.1 m are.

    Args:
        cloud: An object at rest, in the world, (n, 3).
        workspace: Where the moving arm comes from, and how much room the holding arm takes.
    """
    walls = hidden_sides(cloud)
    faces = side_normals(walls) @ np.array(workspace.toward) >= workspace.facing
    free = walls[:, 0] >= cloud[:, 0].min() + workspace.clearance
    distances, _ = cKDTree(cloud).query(walls)
    found = faces & free & (distances > SEEN)
    found.reshape(AROUND, HEIGHTS)[1::2] = False
    return walls[found]
