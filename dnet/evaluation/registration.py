"""Keypoints without learning: the baselines that a trained network is held against."""

import numpy as np
from jaxtyping import Float32, Float64
from scipy.spatial import cKDTree

from dnet.errors import MissingExtra
from dnet.geometry.chamfer import chamfer
from dnet.geometry.sampling import farthest_points
from dnet.nets.keypoints import Keypoints, in_own_order
from dnet.types import Cloud

COUNT = 200
"""Keypoints, as in the paper; of a cloud with fewer points, all of them."""
TURNS = 30
"""Most turns of iterative closest points; it comes to rest before."""
AT_REST = 1e-6
"""Motion below which it has, in metres."""
DRIFTING = 500
"""Points of each cloud for coherent point drift, whose time grows with their product."""


def unmoved(initial: Cloud, goal: Cloud) -> Keypoints:
    """Return keypoints that stay where they are: the least that others must be better than."""
    points = _sample(initial)
    return Keypoints(points, points, chamfer(initial, goal))


def rigid(initial: Cloud, goal: Cloud) -> Keypoints:
    """Return keypoints by iterative closest points (Besl, McKay 1992), each then at the nearest.

    The initial cloud is turned and shifted as a whole until it fits the goal best; a keypoint is
    the point of the goal nearest to where it then is.
    """
    tree = cKDTree(goal)
    moved = initial.astype(np.float64)
    for _ in range(TURNS):
        _, rows = tree.query(moved)
        fitted = _fit(moved, goal[rows].astype(np.float64))
        motion = float(np.abs(fitted - moved).max())
        moved = fitted
        if motion < AT_REST:
            break
    points = _sample(initial)
    _, own = cKDTree(initial).query(points)
    _, rows = tree.query(moved[own])
    return Keypoints(points, goal[rows], chamfer(moved.astype(np.float32), goal))


def coherent(initial: Cloud, goal: Cloud) -> Keypoints:
    """Return keypoints by coherent point drift (Myronenko, Song 2010), as pycpd has it.

    Raises:
        MissingExtra: If pycpd is not there.
    """
    try:
        from pycpd import DeformableRegistration  # noqa: PLC0415
    except ImportError as error:
        raise MissingExtra("pycpd", "registration", "coherent point drift") from error
    source = _sample(initial, DRIFTING)
    target = farthest_points(goal, min(DRIFTING, len(goal)))
    # In units of an object's size, for which its two parameters are meant.
    unit = 10.0
    drift = DeformableRegistration(
        X=unit * target.astype(np.float64),
        Y=unit * source.astype(np.float64),
        alpha=2.0,
        beta=1.0,
        max_iterations=60,
    )
    moved, _ = drift.register()
    carried = (moved / unit).astype(np.float32)
    return Keypoints(source[:COUNT], carried[:COUNT], chamfer(carried, target))


def _sample(cloud: Cloud, most: int = COUNT) -> Float32[np.ndarray, "_ 3"]:
    """Return the points of a cloud that lie farthest from each other, `most` or all of them."""
    count = min(most, len(cloud))
    return in_own_order(cloud, len(cloud), least=count)[:count]


def _fit(
    points: Float64[np.ndarray, "n 3"], targets: Float64[np.ndarray, "n 3"]
) -> Float64[np.ndarray, "n 3"]:
    """Return points turned and shifted to be nearest to their targets (Kabsch 1976)."""
    middle, aim = points.mean(axis=0), targets.mean(axis=0)
    u, _, v = np.linalg.svd((points - middle).T @ (targets - aim))
    u[:, -1] *= np.sign(np.linalg.det(u @ v))
    return (points - middle) @ (u @ v) + aim
