"""What a network needs of every cloud of a dataset: found once, kept beside it, read mapped."""

import os
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, fields
from functools import cached_property
from multiprocessing import get_context
from typing import Any

import numpy as np
from jaxtyping import Int64

from dnet.datasets.clouds import Clouds
from dnet.datasets.frame_table import FrameTable
from dnet.datasets.stores import join
from dnet.datasets.table_cache import Records, TableCache
from dnet.errors import BadEpisode, BadTables, WorkerDied
from dnet.geometry.sampling import farthest_rows
from dnet.nets.deformernet import centroid
from dnet.types import Cloud, Place, Point

CLOUDS_A_PROCESS = 500
"""Clouds below which another process takes longer to start than it saves."""


@dataclass(frozen=True)
class CloudTables(ABC):
    """Records of the frames of a table, a file an episode. Subclasses say what is in them."""

    table: FrameTable

    @property
    @abstractmethod
    def points(self) -> int:
        """Points of a cloud that are looked at, the first ones."""

    @property
    @abstractmethod
    def _dtype(self) -> np.dtype[Any]:
        """Of the records, among whose fields is `frame`."""

    @property
    @abstractmethod
    def _cache(self) -> TableCache:
        """Where they are kept."""

    @abstractmethod
    def _fill(self, record: Any, cloud: Cloud, *, what: str, centre: Point) -> None:
        """Write down what there is to say of a cloud.

        Args:
            record: Its record, whose `frame` is written already.
            cloud: Its points.
            what: Its name in an error.
            centre: The centroid of the first cloud of its episode, in metres.
        """

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
            WorkerDied: If a process that finds them is killed.
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

    def _records(self, rows: Int64[np.ndarray, " k"]) -> Records:
        """Return what is kept of some frames.

        Raises:
            BadTables: If it is not there any more, or damaged.
        """
        found = np.empty(len(rows), self._dtype)
        for place, row in enumerate(rows.tolist()):
            found[place] = self._record(int(self.table.file[row]), int(self.table.frame[row]))
        return found

    def _each(self, files: Sequence[int], workers: int) -> Iterator[int]:
        if workers <= 1:
            yield from map(self._put, files)
            return
        # A fork of a process with threads may hang. So may a pool before Python 3.11.5 if a process
        # dies while it is sent much (python/cpython#94777): the table goes once, not in each call.
        pool = ProcessPoolExecutor(
            workers, mp_context=get_context("spawn"), initializer=_start, initargs=(self,)
        )
        try:
            with pool:
                yield from pool.map(_put, files)
        except BrokenProcessPool as error:
            raise WorkerDied(
                f"described the clouds of {self.table.root}",
                "what it found is kept, run the same command again",
            ) from error

    def _put(self, file: int) -> int:
        """Find and keep the records of one file; return of how many clouds."""
        table = self.table.where(self.table.file == file)
        clouds = Clouds(table)
        records = np.zeros(len(table), self._dtype)
        centre = centroid(clouds[0])
        records["frame"] = table.frame
        name = join(table.root, table.names[file])
        for row, frame in enumerate(table.frame.tolist()):
            cloud = self._taken(clouds[row], name, frame)
            self._fill(records[row], cloud, what=f"frame {frame} of {name}", centre=centre)
        clouds.close()
        self._cache.put(table.digests[file], records)
        return len(table)

    def _taken(self, cloud: Cloud, name: Place, frame: int) -> Cloud:
        """Return the points of a cloud that the network takes, the first ones."""
        count = self.points
        if count < len(cloud):
            rows = farthest_rows(cloud, count)
            if not np.array_equal(rows, np.arange(count)):
                raise BadEpisode(
                    name,
                    f"has in frame {frame} a cloud whose points are not in farthest-point order",
                    f"train on all {len(cloud)} points of its clouds",
                )
        return cloud[:count]

    def _has(self, file: int) -> bool:
        # A changed record would train a wrong network, and nobody would see.
        records = self._cache.find(self.table.digests[file], self._dtype, checked=True)
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
        return {field.name: self.__dict__[field.name] for field in fields(self)}

    @cached_property
    def _mapped(self) -> dict[int, tuple[Any, Records]]:
        return {}


class _Process:
    """What a process that finds tables keeps between files."""

    tables: CloudTables


def _start(tables: CloudTables) -> None:
    _Process.tables = tables


def _put(file: int) -> int:
    return _Process.tables._put(file)
