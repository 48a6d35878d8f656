"""Neighbourhoods of every frame of a dataset, for networks that PointConv is part of."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from jaxtyping import Float32, Int64

from dnet.datasets.table_cache import TableCache, cache_folder
from dnet.errors import BadTables
from dnet.nets.deformernet import DeformerNetConfig, in_unit, prepare
from dnet.nets.neighbourhoods import BANDWIDTHS, GROUPINGS, Neighbourhoods, regroup
from dnet.training.cloud_tables import CloudTables
from dnet.types import Cloud, Point

VERSION = "3"
"""Of how they are found: a change of `dnet.nets.neighbourhoods` that alters them raises it."""
MOST_SAMPLINGS = 8
"""Choices of centroids of a cloud; more of them cost time and teach little more."""

_SAMPLED = ("centroids", "neighbours_1", "neighbours_2", "density_1", "density_2")
"""What depends on the choice of centroids."""


def samplings_for(count: int) -> int:
    """Return how many choices of centroids to keep of each of `count` clouds.

    Few clouds need many: a network must not care which points happen to be centroids, and learns
    that from seeing a cloud with others. Many clouds have variety enough.
    """
    return max(1, min(MOST_SAMPLINGS, 20_000 // count))


@dataclass(frozen=True)
class NeighbourTables(CloudTables):
    """The neighbourhoods of the frames of a table, for one kind of network.

    Centroids, neighbours and densities are kept; the points are in the logs.
    """

    config: DeformerNetConfig
    """Of the network."""
    samplings: int = 1
    """Choices of centroids of each cloud, the usual one first."""

    @property
    def points(self) -> int:
        """Points of a cloud that the network takes."""
        return self.config.points

    def of(
        self,
        rows: Int64[np.ndarray, " k"],
        clouds: Float32[np.ndarray, "k n 3"],
        *,
        choices: Int64[np.ndarray, " k"] | None = None,
    ) -> Neighbourhoods:
        """Return the neighbourhoods of some frames, as a batch.

        Args:
            rows: The frames.
            clouds: Their clouds, in metres.
            choices: Which choice of centroids to take of each; None for the usual one.

        Raises:
            BadTables: If what was kept is not there any more, or damaged.
        """
        found = self._records(rows)
        chosen = np.zeros(len(rows), np.int64) if choices is None else choices
        tables = found["samplings"][np.arange(len(rows)), chosen]
        centroids, one, two, middle, above = (
            torch.from_numpy(np.ascontiguousarray(tables[name])) for name in _SAMPLED
        )
        first, _ = GROUPINGS[self.config.size]
        for rows_below, count in (
            (centroids, self.config.points),
            (one, self.config.points),
            (two, first.centroids),
        ):
            # A row beyond the cloud would be read out of other memory.
            if rows_below.min() < 0 or rows_below.max() >= count:
                raise BadTables(self._cache.folder, "a row of a neighbour is beyond its cloud")
        below = torch.from_numpy(np.ascontiguousarray(found["density"]))
        points = torch.from_numpy(in_unit(clouds, self.config, centres=found["centre"]))
        return Neighbourhoods(points, centroids, (one, two), (below, middle, above))

    def _fill(self, record: Any, cloud: Cloud, *, what: str, centre: Point) -> None:
        found = prepare(cloud, self.config, what=what, centre=centre)
        record["centre"] = centre
        record["density"] = found.inverse_densities[0].numpy()
        for choice in range(self.samplings):
            record["samplings"][choice] = self._sampled(found, int(record["frame"]), choice)

    def _sampled(self, found: Neighbourhoods, frame: int, choice: int) -> tuple[Any, ...]:
        if choice:
            start = int(np.random.default_rng((frame, choice)).integers(self.config.points))
            found = regroup(found, GROUPINGS[self.config.size], start=start)
        tensors = (found.centroids, *found.neighbours, *found.inverse_densities[1:])
        return tuple(tensor.numpy() for tensor in tensors)

    @property
    def _cache(self) -> TableCache:
        config = self.config
        version = (
            VERSION,
            GROUPINGS[config.size],
            BANDWIDTHS,
            config.points,
            config.coordinate_unit,
        )
        folder = cache_folder(self.table.root)
        return TableCache(folder, "neighbourhoods", repr((*version, self.samplings)))

    @property
    def _dtype(self) -> np.dtype[Any]:
        first, second = GROUPINGS[self.config.size]
        shapes = (
            ("<i2", (first.centroids,)),
            ("<i2", (first.centroids, first.neighbours)),
            ("<i2", (second.centroids, second.neighbours)),
            ("<f4", (first.centroids,)),
            ("<f4", (second.centroids,)),
        )
        sampled = [(name, *shape) for name, shape in zip(_SAMPLED, shapes, strict=True)]
        fields = [
            ("frame", "<i4"),
            ("centre", "<f8", (3,)),
            ("density", "<f4", (self.config.points,)),
            ("samplings", np.dtype(sampled, align=True), (self.samplings,)),
        ]
        return np.dtype(fields, align=True)
