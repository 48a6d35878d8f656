"""Farthest point sampling: few points that cover a cloud evenly, in an order worth keeping."""

from typing import no_type_check

import numpy as np
from jaxtyping import Float32, Int64, UInt16
from numba import njit

from dnet.errors import BadCloud, ShortCloud
from dnet.types import Cloud

BLOCK = 64
"""Neighbouring points that are looked at, or passed over, together; it changes the speed alone."""
CELL_BITS = 5
"""The grid that finds neighbours has 2^5 cells along the longest side of the cloud."""


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
    """Return the rows of `farthest_points(cloud, count, start=start)`, which see.

    Among points equally far the lowest row comes first, and no row comes twice, so the result
    is the same on every machine. Neighbours are kept in blocks, and a block that is too far from
    the newest point to come nearer to it is passed over, as in QuickFPS (Han et al. 2023).
    """
    if len(cloud) < count:
        raise ShortCloud(len(cloud), count)
    bad = int((~np.isfinite(cloud).all(axis=1)).sum())
    if bad:
        raise BadCloud("cloud", bad, len(cloud))
    if count == 0:
        return np.zeros(0, np.int64)
    rows = np.argsort(_cells(cloud), kind="stable")
    axes = np.ascontiguousarray(cloud[rows].T)
    first = int(np.flatnonzero(rows == start)[0])
    return _greedy(axes, rows, first, count)


def _cells(cloud: Cloud) -> UInt16[np.ndarray, "_"]:
    """Return the number of the grid cell of each point, near cells mostly near in number.

    The bits of x, y and z in turn (Morton 1966), in 16 bits, which numpy sorts fastest.
    """
    low = cloud.min(axis=0).astype(np.float64)
    span = max(float((cloud.max(axis=0) - low).max()), np.finfo(np.float64).tiny)
    place = np.minimum((cloud - low) / span * 2**CELL_BITS, 2**CELL_BITS - 1).astype(np.uint16)
    number = np.zeros(len(cloud), np.uint16)
    for bit in range(CELL_BITS):
        for axis in range(3):
            number |= ((place[:, axis] >> bit) & 1) << (3 * bit + axis)
    return number


# With its types given it is compiled, or found compiled, at import: no call takes longer than
# another. Compiled code knows no shape checks.
@njit("int64[::1](float32[:, ::1], int64[::1], int64, int64)", cache=True)
@no_type_check
def _greedy(
    axes: Float32[np.ndarray, "3 n"], rows: Int64[np.ndarray, "n"], first: int, count: int
) -> Int64[np.ndarray, "{count}"]:
    """Return the rows of a sample that starts with column `first` of `axes`.

    The columns of `axes` are the points in the order of `rows`. Rounding keeps order, so the
    distance to a block's bounding box never comes out above that to a point in the block, and
    what is passed over could not have changed.
    """
    x, y, z = axes
    points = len(rows)
    blocks = (points + BLOCK - 1) // BLOCK
    low = np.empty((blocks, 3), np.float32)
    high = np.empty((blocks, 3), np.float32)
    for block in range(blocks):
        for axis in range(3):
            part = axes[axis, block * BLOCK : (block + 1) * BLOCK]
            low[block, axis] = part.min()
            high[block, axis] = part.max()

    # Squared distance of each point to the nearest chosen one, -1 for the chosen themselves.
    squared = np.full(points, np.inf, np.float32)
    farthest = np.zeros(blocks, np.int64)
    reach = np.full(blocks, np.inf, np.float32)
    chosen = first
    found = np.empty(count, np.int64)
    for turn in range(count):
        found[turn] = rows[chosen]
        squared[chosen] = -1.0
        home = chosen // BLOCK
        at_x, at_y, at_z = x[chosen], y[chosen], z[chosen]
        best = 0
        for block in range(blocks):
            dx = max(low[block, 0] - at_x, at_x - high[block, 0], np.float32(0.0))
            dy = max(low[block, 1] - at_y, at_y - high[block, 1], np.float32(0.0))
            dz = max(low[block, 2] - at_z, at_z - high[block, 2], np.float32(0.0))
            if dx * dx + dy * dy + dz * dz < reach[block] or block == home:
                begin, end = block * BLOCK, min(points, (block + 1) * BLOCK)
                for i in range(begin, end):
                    dx, dy, dz = x[i] - at_x, y[i] - at_y, z[i] - at_z
                    squared[i] = min(squared[i], dx * dx + dy * dy + dz * dz)
                far = begin
                for i in range(begin + 1, end):
                    if squared[i] > squared[far] or (
                        squared[i] == squared[far] and rows[i] < rows[far]
                    ):
                        far = i
                farthest[block], reach[block] = far, squared[far]
            if reach[block] > reach[best] or (
                reach[block] == reach[best] and rows[farthest[block]] < rows[farthest[best]]
            ):
                best = block
        chosen = farthest[best]
    return found
