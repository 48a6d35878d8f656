"""Farthest point sampling: few points that cover a cloud evenly, in an order worth keeping."""

import fpsample
import numpy as np

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
    if len(cloud) < count:
        raise ShortCloud(len(cloud), count)
    bad = int((~np.isfinite(cloud).all(axis=1)).sum())
    if bad:
        raise BadCloud("cloud", bad, len(cloud))
    chosen = fpsample.fps_sampling(cloud, count, start_idx=start)
    return cloud[np.asarray(chosen, dtype=np.intp)]
