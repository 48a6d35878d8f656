"""Neighbourhoods of an episode's clouds: found anew, or once and kept beside the data."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import torch

from dnet.datasets.table_cache import TableCache, Tables, cache_folder
from dnet.nets.deformernet import DeformerNetConfig, in_unit, prepare
from dnet.nets.neighbourhoods import BANDWIDTHS, GROUPINGS, Neighbourhoods
from dnet.types import Cloud, Place

VERSION = "1"
"""Of how they are found: a change of `dnet.nets.neighbourhoods` that alters them raises it."""

_NAMES = ("centroids", "neighbours_1", "neighbours_2", "density_0", "density_1", "density_2")


@runtime_checkable
class FindNeighbourhoods(Protocol):
    """Finds the neighbourhoods of some clouds of one episode, given by frame."""

    def __call__(
        self, path: Place, clouds: Mapping[int, Cloud], config: DeformerNetConfig
    ) -> list[Neighbourhoods]:
        """Return them in the order of the clouds."""
        ...


def find_each(
    path: Place, clouds: Mapping[int, Cloud], config: DeformerNetConfig
) -> list[Neighbourhoods]:
    """Return the neighbourhoods of each cloud, found anew.

    Raises:
        BadCloud: If a coordinate is NaN or infinite.
    """
    return [
        prepare(cloud, config, what=f"frame {frame} of {path}") for frame, cloud in clouds.items()
    ]


@dataclass(frozen=True)
class KeptNeighbourhoods:
    """Finds the neighbourhoods of an episode once for each kind of network.

    Centroids, neighbours and densities are kept; the points are in the log.
    """

    root: Place
    """The dataset, beside which they are kept."""
    digests: Mapping[Place, str]
    """SHA-256 of each of its files."""

    def __call__(
        self, path: Place, clouds: Mapping[int, Cloud], config: DeformerNetConfig
    ) -> list[Neighbourhoods]:
        """Return the neighbourhoods of these clouds, which must be all that are ever asked for.

        Raises:
            BadCloud: If a coordinate is NaN or infinite.
        """
        version = (VERSION, GROUPINGS[config.size], BANDWIDTHS, config.coordinate_unit)
        cache = TableCache(cache_folder(self.root), "neighbourhoods", repr(version))
        tables = cache.get(self.digests[path], lambda: _tables(find_each(path, clouds, config)))
        return [
            _row(tables, row, cloud=cloud, config=config)
            for row, cloud in enumerate(clouds.values())
        ]


def _tables(found: list[Neighbourhoods]) -> Tables:
    columns = [(one.centroids, *one.neighbours, *one.inverse_densities) for one in found]
    return {
        name: np.stack([table.numpy() for table in column])
        for name, column in zip(_NAMES, zip(*columns, strict=True), strict=True)
    }


def _row(tables: Tables, row: int, *, cloud: Cloud, config: DeformerNetConfig) -> Neighbourhoods:
    centroids, one, two, below, middle, above = (
        torch.from_numpy(tables[name][row]) for name in _NAMES
    )
    points = torch.from_numpy(in_unit(cloud, config))
    return Neighbourhoods(points, centroids, (one, two), (below, middle, above))
