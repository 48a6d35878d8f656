"""What PointConv needs of a cloud's coordinates alone: neighbours and densities, found once."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from jaxtyping import Float, Float32, Int16, Integer
from scipy.spatial import cKDTree
from torch import Tensor

from dnet.geometry.sampling import farthest_rows
from dnet.types import Cloud

Size = Literal["light", "paper"]
"""`paper`: the levels of DeformerNet; `light`: fewer centroids, a quarter of the time."""


@dataclass(frozen=True, slots=True)
class Grouping:
    """How one level of a network groups the points of the level below."""

    centroids: int
    """Points that stay, the farthest from each other."""
    neighbours: int
    """Nearest points that each centroid gathers, itself among them."""


GROUPINGS: dict[Size, tuple[Grouping, Grouping]] = {
    "light": (Grouping(128, 16), Grouping(32, 32)),
    "paper": (Grouping(512, 32), Grouping(128, 64)),
}
"""The first two levels of each network; the third gathers all that is left."""

BANDWIDTHS = (0.1, 0.2, 0.4)
"""Of the density at each level, in the unit of the coordinates (PointConv, public code)."""

MOST_POINTS = 2**15 - 1
"""Of a cloud: its rows are kept as int16, so that tens of thousands of clouds fit in memory."""

# Rows of the distance matrix held at once: 128 x 2048 floats stay in a processor's cache.
_ROWS = 128


@dataclass(frozen=True, slots=True)
class Neighbourhoods:
    """A cloud in a network's unit, who is near whom in it, and how crowded each point is.

    One cloud or a batch of them, with the batch in front. Rotating, shifting or mirroring
    `points` leaves the rest true.
    """

    points: Float[Tensor, "*batch n 3"]
    """Coordinates in the network's unit."""
    centroids: Int16[Tensor, "*batch s1"]
    """Rows of `points` that stay at the first level; the first ones of these stay at the next."""
    neighbours: tuple[Int16[Tensor, "*batch s1 k1"], Int16[Tensor, "*batch s2 k2"]]
    """For each of the first two levels: rows of the level below that each centroid gathers."""
    inverse_densities: tuple[
        Float[Tensor, "*batch n"], Float[Tensor, "*batch s1"], Float[Tensor, "*batch s2"]
    ]
    """For each level: one over the density at every point that it gathers from."""

    def __len__(self) -> int:
        """Return how many clouds a batch has."""
        return len(self.points)

    def to(self, device: torch.device) -> "Neighbourhoods":
        """Return the same tables on `device`."""
        return self._map(lambda table: table.to(device, non_blocking=True))

    def pin_memory(self) -> "Neighbourhoods":
        """Return the same tables in memory from which a GPU reads fastest."""
        return self._map(torch.Tensor.pin_memory)

    def take(self, clouds: Integer[Tensor, " k"]) -> "Neighbourhoods":
        """Return some clouds of a batch, in this order."""
        return self._map(lambda table: table[clouds])

    def _map(self, change: Callable[[Tensor], Tensor]) -> "Neighbourhoods":
        first, second = self.neighbours
        below, middle, above = self.inverse_densities
        return Neighbourhoods(
            change(self.points),
            change(self.centroids),
            (change(first), change(second)),
            (change(below), change(middle), change(above)),
        )


def find_neighbourhoods(
    points: Cloud, groupings: tuple[Grouping, Grouping], *, start: int = 0
) -> Neighbourhoods:
    """Return the neighbourhoods of one cloud.

    Args:
        points: Coordinates in the network's unit, (n, 3); at least as many as the first level
            has centroids and neighbours.
        groupings: The first two levels.
        start: Row of the first centroid, from which the others are sampled. With 0, the
            centroids of a cloud in farthest-point order are its first points.
    """
    density = _inverse_density(points, BANDWIDTHS[0])
    return _group(torch.from_numpy(np.array(points)), density, groupings, start=start)


def regroup(
    cloud: Neighbourhoods, groupings: tuple[Grouping, Grouping], *, start: int
) -> Neighbourhoods:
    """Return a single cloud with other centroids, sharing the memory of what stays the same."""
    return _group(cloud.points, cloud.inverse_densities[0], groupings, start=start)


def stack(clouds: Sequence[Neighbourhoods]) -> Neighbourhoods:
    """Return single clouds as one batch; all must have the same counts."""
    return Neighbourhoods(
        torch.stack([one.points for one in clouds]),
        torch.stack([one.centroids for one in clouds]),
        (
            torch.stack([one.neighbours[0] for one in clouds]),
            torch.stack([one.neighbours[1] for one in clouds]),
        ),
        (
            torch.stack([one.inverse_densities[0] for one in clouds]),
            torch.stack([one.inverse_densities[1] for one in clouds]),
            torch.stack([one.inverse_densities[2] for one in clouds]),
        ),
    )


def _group(
    points: Float32[Tensor, "n 3"],
    inverse_density: Float32[Tensor, " n"],
    groupings: tuple[Grouping, Grouping],
    *,
    start: int,
) -> Neighbourhoods:
    first, second = groupings
    below = points.numpy()
    rows = farthest_rows(below, first.centroids, start=start)
    middle = below[rows]
    above = middle[: second.centroids]
    return Neighbourhoods(
        points,
        torch.from_numpy(rows.astype(np.int16)),
        (_nearest(middle, below, first.neighbours), _nearest(above, middle, second.neighbours)),
        (
            inverse_density,
            _inverse_density(middle, BANDWIDTHS[1]),
            _inverse_density(above, BANDWIDTHS[2]),
        ),
    )


def _nearest(centroids: Cloud, points: Cloud, count: int) -> Int16[Tensor, "_ {count}"]:
    _, rows = cKDTree(points).query(centroids, k=count)
    return torch.from_numpy(np.asarray(rows, dtype=np.int16).reshape(len(centroids), count))


def _inverse_density(points: Cloud, bandwidth: float) -> Float32[Tensor, "_"]:
    """Return one over the Gaussian kernel density at each point (Wu, Qi, Fuxin 2019).

    Distances come from differences: the expansion |a|^2 + |b|^2 - 2ab loses in float32 the
    digits that matter as soon as the cloud stands away from the origin. In numpy, since these
    many small steps wait for each other on several threads, most of all on a busy machine.
    """
    x, y, z = np.ascontiguousarray(points.T)
    exponent = np.float32(-1 / (2 * bandwidth**2))
    sums = np.zeros(len(points), dtype=np.float32)
    for first in range(0, len(points), _ROWS):
        last = min(first + _ROWS, len(points))
        rows = points[first:last]
        # Each two points meet once: those before have met these rows already.
        squares = np.square(rows[:, :1] - x[first:])
        squares += np.square(rows[:, 1:2] - y[first:])
        squares += np.square(rows[:, 2:] - z[first:])
        squares *= exponent
        kernel = np.exp(squares, out=squares)
        sums[first:last] += kernel.sum(axis=1)
        sums[last:] += kernel[:, last - first :].sum(axis=0)
    return torch.from_numpy(np.float32(2.5 * bandwidth) * np.float32(len(points)) / sums)
