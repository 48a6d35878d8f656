"""Fitting one cloud onto another, smoothly: a few turns of closest points without rigidity."""

import numpy as np
from jaxtyping import Float64
from scipy.spatial import cKDTree

from dnet.types import Cloud

TURNS = 4
"""Of pulling and smoothing; more of them change little."""
NEIGHBOURS = 24
"""Points, itself among them, that a pull is smoothed over: of 1024 on 0.1 m, those within 1 cm."""
SMOOTHINGS = 2
"""Times that pulls are smoothed in a turn."""


def fit(cloud: Cloud, moved: Cloud, goal: Cloud) -> Cloud:
    """Return where the points of a cloud are, once what moved them nearly to a goal is made exact.

    Each point is pulled to the nearest of the goal, and by every point of the goal that it is
    the nearest to; what neighbours have in common of these pulls is followed. So a surface comes
    to lie on the goal as a whole, and points keep their order on it (after non-rigid iterative
    closest points; Amberg, Romdhani, Vetter 2007).

    Args:
        cloud: As it was, which says who are neighbours, (n, 3).
        moved: Where its points are said to be, (n, 3).
        goal: What it is to lie on, (m, 3).
    """
    count = min(NEIGHBOURS, len(cloud))
    found, rows = cKDTree(cloud).query(cloud, k=count)
    distances = np.asarray(found, np.float64).reshape(len(cloud), count)
    near = np.asarray(rows, np.int64).reshape(len(cloud), count)
    weights = np.exp(-np.square(distances / np.maximum(distances[:, -1:], np.finfo(float).tiny)))
    weights /= weights.sum(axis=1, keepdims=True)
    target, tree = goal.astype(np.float64), cKDTree(goal)
    points = moved.astype(np.float64)
    for _ in range(TURNS):
        pull = _pulls(points, target, tree)
        for _ in range(SMOOTHINGS):
            pull = np.einsum("nk,nkx->nx", weights, pull[near])
        points += pull
    return points.astype(np.float32)


def _pulls(
    points: Float64[np.ndarray, "n 3"], goal: Float64[np.ndarray, "m 3"], tree: "cKDTree[None]"
) -> Float64[np.ndarray, "n 3"]:
    """Return how far each point is pulled: the mean over all that pull it."""
    _, there = tree.query(points)
    # A tree for one search: one that is balanced takes longer to build than it saves.
    _, back = cKDTree(points, balanced_tree=False, compact_nodes=False).query(goal)
    sums, counts = goal[there] - points, np.ones(len(points))
    np.add.at(sums, back, goal - points[back])
    np.add.at(counts, back, 1.0)
    return sums / counts[:, None]
