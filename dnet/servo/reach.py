"""Which points of a cloud the gripper can reach, by the cloud and the workspace alone."""

import numpy as np
from jaxtyping import Bool

from dnet.geometry.camera import Camera
from dnet.geometry.normals import normals
from dnet.sim.scenes import Workspace
from dnet.types import Cloud, Point


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
