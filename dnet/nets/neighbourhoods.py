"""What PointConv needs of a cloud's coordinates alone: neighbours and densities, found once."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from jaxtyping import Float, Float32, Int16, Integer
from scipy.spatial import cKDTree
from torch import Tensor

from dnet.types import Cloud

Size = Literal["light", "paper"]
"""`paper`: the levels of DeformerNet; `light`: fewer centroids, a quarter of the time."""


@dataclass(frozen=True, slots=True)
class Grouping:
    """How one level of a network groups the points of the level below."""

    centroids: int
    """Points that stay: the first ones, since a cloud comes in farthest-point order."""
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

_ROWS = 128
# Rows of the distance matrix held at once: 128 x 2048 floats stay in a processor's cache.


@dataclass(frozen=True, slots=True)
class Neighbourhoods:
    """A cloud in a network's unit, who is near whom in it, and how crowded each point is.

    One cloud or a batch of them, with the batch in front. Rotating, shifting or mirroring
    `points` leaves the rest true.
    """

    points: Float[Tensor, "*batch n 3"]
    """Coordinates in farthest-point order, in the network's unit."""
    neighbours: tuple[Int16[Tensor, "*batch s1 k1"], Int16[Tensor, "*batch s2 k2"]]
    """For each of the first two levels: rows that each centroid gathers."""
    inverse_densities: tuple[
        Float[Tensor, "*batch n"], Float[Tensor, "*batch s1"], Float[Tensor, "*batch s2"]
    ]
    """For each level: one over the density at every point that it gathers from."""

    def __len__(self) -> int:
        """Return how many clouds the batch holds."""
        return len(self.points)

    def take(self, rows: Integer[Tensor, "_"]) -> "Neighbourhoods":
        """Return the clouds `rows` of a batch, as a batch."""
        return Neighbourhoods(
            self.points[rows],
            (self.neighbours[0][rows], self.neighbours[1][rows]),
            (
                self.inverse_densities[0][rows],
                self.inverse_densities[1][rows],
                self.inverse_densities[2][rows],
            ),
        )

    def to(self, device: torch.device) -> "Neighbourhoods":
        """Return the same tables on `device`."""
        return Neighbourhoods(
            self.points.to(device),
            (self.neighbours[0].to(device), self.neighbours[1].to(device)),
            (
                self.inverse_densities[0].to(device),
                self.inverse_densities[1].to(device),
                self.inverse_densities[2].to(device),
            ),
        )


def find_neighbourhoods(points: Cloud, groupings: tuple[Grouping, Grouping]) -> Neighbourhoods:
    """Return the neighbourhoods of one cloud.

    Args:
        points: Coordinates in farthest-point order and in the network's unit, (n, 3); at least
            as many as the first level has centroids and neighbours.
        groupings: The first two levels.
    """
    first, second = groupings
    below, middle, above = points, points[: first.centroids], points[: second.centroids]
    return Neighbourhoods(
        torch.from_numpy(np.array(points)),
        (_nearest(middle, below, first.neighbours), _nearest(above, middle, second.neighbours)),
        (
            _inverse_density(below, BANDWIDTHS[0]),
            _inverse_density(middle, BANDWIDTHS[1]),
            _inverse_density(above, BANDWIDTHS[2]),
        ),
    )


def stack(clouds: Sequence[Neighbourhoods]) -> Neighbourhoods:
    """Return single clouds as one batch; all must have the same counts."""
    return Neighbourhoods(
        torch.stack([one.points for one in clouds]),
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


def _nearest(centroids: Cloud, points: Cloud, count: int) -> Int16[Tensor, "_ {count}"]:
    _, rows = cKDTree(points).query(centroids, k=count)
    return torch.from_numpy(np.asarray(rows, dtype=np.int16).reshape(len(centroids), count))


def _inverse_density(points: Cloud, bandwidth: float) -> Float32[Tensor, "_"]:
    """Return one over the Gaussian kernel density at each point (Wu, Qi, Fuxin 2019).

    Distances come from differences: the expansion |a|^2 + |b|^2 - 2ab loses in float32 the
    digits that matter as soon as the cloud stands away from the origin.
    """
    cloud = torch.from_numpy(np.array(points))
    x, y, z = cloud.T.contiguous()
    densities = []
    for rows in torch.split(cloud, _ROWS):
        squares = (rows[:, :1] - x).square_()
        for axis, coordinates in ((1, y), (2, z)):
            difference = rows[:, axis, None] - coordinates
            squares.addcmul_(difference, difference)
        kernel = squares.mul_(-1 / (2 * bandwidth**2)).exp_()
        densities.append(kernel.mean(dim=1) / (2.5 * bandwidth))
    return 1 / torch.cat(densities)
