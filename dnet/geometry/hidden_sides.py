"""The sides of an object on a table that a camera above it does not see."""

import numpy as np
from jaxtyping import Float32, Float64
from scipy.spatial import ConvexHull, cKDTree

from dnet.types import Cloud

AROUND, HEIGHTS = 80, 6
SIDE_POINTS = AROUND * HEIGHTS
"""Points of `hidden_sides`."""


def hidden_sides(cloud: Cloud) -> Float32[np.ndarray, "walls 3"]:
    """Return points on vertical walls from the outline of a cloud down to its lowest height.

    The outline is the convex hull seen from above, walked in equal steps; each wall is as high as
    the cloud is next to it. A box is completed by its sides; of an object whose outline lies on
    the table, all of them lie there too. Some of the walls are seen already.

    Args:
        cloud: An object that lies on a table, z up, in any unit; four points or more, not all on
            one vertical plane.
    """
    points = cloud.astype(np.float64)
    corners = points[ConvexHull(points[:, :2]).vertices]
    closed = np.concatenate([corners, corners[:1]])[:, :2]
    lengths = np.linalg.norm(np.diff(closed, axis=0), axis=1)
    walked = np.concatenate([[0.0], np.cumsum(lengths)])
    steps = np.linspace(0, walked[-1], AROUND, endpoint=False)
    outline = np.stack([np.interp(steps, walked, closed[:, axis]) for axis in (0, 1)], axis=1)
    # As high as the highest of what is near: the nearest alone may lie at the foot of a side.
    _, near = cKDTree(points[:, :2]).query(outline, k=min(8, len(points)))
    top = points[np.asarray(near).reshape(AROUND, -1), 2].max(axis=1)
    bottom = points[:, 2].min()
    shares = (np.arange(HEIGHTS) + 0.5) / HEIGHTS
    heights = bottom + (top - bottom)[:, None] * shares
    walls = np.concatenate(
        [np.repeat(outline[:, None], HEIGHTS, axis=1), heights[..., None]], axis=2
    )
    return walls.reshape(-1, 3).astype(np.float32)


def side_normals(walls: Float32[np.ndarray, "walls 3"]) -> Float64[np.ndarray, "walls 3"]:
    """Return the unit normals of walls of `hidden_sides`, level and outwards.

    Each is square to the way from the last step of the outline to the next; at a corner it is half
    way between those of the two walls.
    """
    outline = walls.reshape(AROUND, HEIGHTS, 3)[:, 0, :2].astype(np.float64)
    along = np.roll(outline, -1, axis=0) - np.roll(outline, 1, axis=0)
    # The hull is walked against the clock, so that outside is to the right.
    outwards = np.stack([along[:, 1], -along[:, 0], np.zeros(AROUND)], axis=1)
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    return np.repeat(outwards, HEIGHTS, axis=0)
