"""Farthest point sampling: few points that cover a cloud evenly, in an order worth keeping."""

import fpsample
import numpy as np
from jaxtyping import Int64

from dnet.errors import BadCloud, ShortCloud
from dnet.types import Cloud


def farthest_points(cloud: Cloud, count: int, *, start: int = 0) -> Cloud:
    """Return `count` points of `cloud`, each the farthest from those before it.

    Every prefix of the result is itself a farthest point sample, so a network finds the
    centroids of its coarser levels in the first rows. Exact and greedy (Eldar et al. 1997).

    Args:
        cloud: Points in metres, (n, 3).
        count: How many to keep.
        start: Row of `cloud` to begin with.

    Raises:
        ShortCloud: If the cloud has fewer than `count` points.
        BadCloud: If a coordinate is NaN or infinite.
    """
    return cloud[farthest_rows(cloud, count, start=start)]


def farthest_rows(cloud: Cloud, count: int, *, start: int = 0) -> Int64[np.ndarray, "{count}"]:
    """Return the rows of `farthest_points(cloud, count, start=start)`, which see."""
    if len(cloud) < count:
        raise ShortCloud(len(cloud), count)
    bad = int((~np.isfinite(cloud).all(axis=1)).sum())
    if bad:
        raise BadCloud("cloud", bad, len(cloud))
    rows = fpsample.fps_sampling(cloud, count, start_idx=start)
    return np.asarray(rows, dtype=np.int64)
