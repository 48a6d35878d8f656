"""Neighbourhoods of every frame of a dataset: found once, kept beside it, mapped when read."""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cached_property, partial
from multiprocessing import get_context
from typing import Any

import numpy as np
import torch
from jaxtyping import Float32, Int64

from dnet.datasets.clouds import Clouds
from dnet.datasets.frame_table import FrameTable
from dnet.datasets.stores import join
from dnet.datasets.table_cache import Records, TableCache, cache_folder
from dnet.errors import BadEpisode, BadTables
from dnet.geometry.sampling import farthest_rows
from dnet.nets.deformernet import DeformerNetConfig, centroid, in_unit, prepare
from dnet.nets.neighbourhoods import BANDWIDTHS, GROUPINGS, Neighbourhoods, regroup
from dnet.types import Cloud, Place

VERSION = "3"
"""Of how they are found: a change of `dnet.nets.neighbourhoods` that alters them raises it."""
MOST_SAMPLINGS = 8
"""Choices of centroids of a cloud; more of them cost time and teach little more."""
CLOUDS_A_PROCESS = 500
"""Clouds below which another process takes longer to start than it saves."""

_SAMPLED = ("centroids", "neighbours_1", "neighbours_2", "density_1", "density_2")
"""What depends on the choice of centroids."""


def samplings_for(count: int) -> int:
    """Return how many choices of centroids to keep of each of `count` clouds.

    Few clouds need many: a network must not care which points happen to be centroids, and learns
    that from seeing a cloud with others. Many clouds have variety enough.
    """
    return max(1, min(MOST_SAMPLINGS, 20_000 // count))


@dataclass(frozen=True)
class NeighbourTables:
    """The neighbourhoods of the frames of a table, for one kind of network.

    Centroids, neighbours and densities are kept; the points are in the logs.
    """

    table: FrameTable
    config: DeformerNetConfig
    """Of the network."""
    samplings: int = 1
    """Choices of centroids of each cloud, the usual one first."""

    def build(
        self, *, workers: int | None = None, on_clouds: Callable[[int], None] = lambda _: None
    ) -> None:
        """Find those that are not kept yet.

        Args:
            workers: Processes to find them with; None for a good number.
            on_clouds: Called with how many clouds are done, as they are.

        Raises:
            BadCloud: If a coordinate is NaN or infinite.
            BadEpisode: If the network takes fewer points than a cloud has, and the points of the
                cloud are not in farthest-point order, so that its first ones will not do.
            ChangedEpisode: If a file is not the one that was indexed.
            Unwritten: If they cannot be kept.
        """
        missing = []
        for file, count in enumerate(self.table.lengths.tolist()):
            if count and not self._has(file):
                missing.append(file)
            else:
                on_clouds(count)
        clouds = int(np.isin(self.table.file, missing).sum())
        count = min(os.cpu_count() or 1, clouds // CLOUDS_A_PROCESS) if workers is None else workers
        for done in self._each(missing, count):
            on_clouds(done)

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
        found = np.empty(len(rows), self._dtype)
        for place, row in enumerate(rows.tolist()):
            found[place] = self._record(int(self.table.file[row]), int(self.table.frame[row]))
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

    def _each(self, files: Sequence[int], workers: int) -> Iterator[int]:
        if workers <= 1:
            yield from map(self._put, files)
            return
        # A fork of a process with threads may hang.
        with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as executor:
            yield from executor.map(partial(NeighbourTables._put, self), files)

    def _put(self, file: int) -> int:
        """Find and keep the neighbourhoods of one file; return of how many clouds."""
        table = self.table.where(self.table.file == file)
        clouds = Clouds(table)
        records = np.zeros(len(table), self._dtype)
        centre = centroid(clouds[0])
        records["frame"], records["centre"] = table.frame, centre
        name = join(table.root, table.names[file])
        for row, frame in enumerate(table.frame.tolist()):
            cloud = self._taken(clouds[row], name, frame)
            found = prepare(cloud, self.config, what=f"frame {frame} of {name}", centre=centre)
            records["density"][row] = found.inverse_densities[0].numpy()
            for choice in range(self.samplings):
                records["samplings"][row, choice] = self._sampled(found, frame, choice)
        clouds.close()
        self._cache.put(table.digests[file], records)
        return len(table)

    def _taken(self, cloud: Cloud, name: Place, frame: int) -> Cloud:
        """Return the points of a cloud that the network takes, the first ones."""
        count = self.config.points
        if count < len(cloud):
            rows = farthest_rows(cloud, count)
            if not np.array_equal(rows, np.arange(count)):
                raise BadEpisode(
                    name,
                    f"has in frame {frame} a cloud whose points are not in farthest-point order",
                    f"train on all {len(cloud)} points of its clouds",
                )
        return cloud[:count]

    def _sampled(self, found: Neighbourhoods, frame: int, choice: int) -> tuple[Any, ...]:
        if choice:
            start = int(np.random.default_rng((frame, choice)).integers(self.config.points))
            found = regroup(found, GROUPINGS[self.config.size], start=start)
        tensors = (found.centroids, *found.neighbours, *found.inverse_densities[1:])
        return tuple(tensor.numpy() for tensor in tensors)

    def _has(self, file: int) -> bool:
        records = self._cache.find(self.table.digests[file], self._dtype)
        frames = self.table.frame[self.table.file == file]
        return records is not None and np.array_equal(records["frame"], frames)

    def _record(self, file: int, frame: int) -> Any:
        if file not in self._mapped:
            records = self._cache.find(self.table.digests[file], self._dtype)
            if records is None:
                raise BadTables(self._cache.folder, f"{self.table.digests[file]}.npy is not whole")
            self._mapped[file] = np.array(records["frame"]), records
        frames, records = self._mapped[file]
        place = int(np.searchsorted(frames, frame))
        if place == len(frames) or frames[place] != frame:
            raise BadTables(self._cache.folder, f"frame {frame} is not there")
        return records[place]

    def __getstate__(self) -> dict[str, Any]:
        # Mapped files do not travel between processes; where they are does.
        kept = ("table", "config", "samplings")
        return {name: value for name, value in self.__dict__.items() if name in kept}

    @cached_property
    def _mapped(self) -> dict[int, tuple[Any, Records]]:
        return {}

    @cached_property
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

    @cached_property
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
