"""The settled shapes of a dataset, each beside the rest shape that it came from."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

from dnet.datasets.clouds import Clouds
from dnet.datasets.frame_table import FrameTable
from dnet.errors import TooFew
from dnet.geometry.chamfer_to import ChamferTo
from dnet.types import Cloud, Point


@dataclass(frozen=True, slots=True)
class Shape:
    """A settled shape."""

    name: str
    """Episode and frame, for people."""
    cloud: Cloud
    rest: Cloud
    """What it was before any motion."""
    grasp: Point
    """The manipulation point, in metres."""
    motion: Point
    """Of the manipulation point since rest, in metres."""


class Shapes:
    """The settled shapes of a dataset in its order, the clouds of which are read when asked for.

    Args:
        table: Settled frames.

    Raises:
        TooFew: If all of them are rest shapes.
    """

    def __init__(self, table: FrameTable) -> None:
        self.table = table
        self._rows = np.flatnonzero(~table.rest)
        if not len(self._rows):
            raise TooFew(f"number of shapes in {table.root} other than at rest", 0, 1)
        first = np.cumsum(table.lengths) - table.lengths
        self._rests = first[table.file[self._rows]]
        self._clouds = Clouds(table)

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def grasps(self) -> Float64[np.ndarray, "_ 3"]:
        """The manipulation point of each shape, in metres."""
        return self.table.grasps[self._rows]

    @property
    def motions(self) -> Float64[np.ndarray, "_ 3"]:
        """How far each manipulation point is from where it was at rest, in metres."""
        return self.grasps - self.table.grasps[self._rests]

    def shape(self, number: int) -> Shape:
        """Return the shape of that number.

        Raises:
            ChangedEpisode: If its file is not the one that was indexed.
            BadEpisode: If a compressed chunk cannot be read.
            Unfetched: If a store does not answer.
        """
        row, rest, table = int(self._rows[number]), int(self._rests[number]), self.table
        return Shape(
            name=f"{table.episodes[table.file[row]]}:{table.frame[row]}",
            cloud=self._clouds[row],
            rest=self._clouds[rest],
            grasp=table.grasps[row],
            motion=table.grasps[row] - table.grasps[rest],
        )

    def distances(
        self,
        numbers: Int64[np.ndarray, " n"],
        *,
        on_shape: Callable[[int, int], None] = lambda _done, _total: None,
    ) -> Float64[np.ndarray, " n"]:
        """Return how far some shapes are from their rest shapes, in metres.

        Args:
            numbers: Of the shapes, those of an episode together.
            on_shape: Called with the number of shapes measured and of all.
        """
        found = np.zeros(len(numbers))
        for place, distance in enumerate(self._distances(numbers)):
            found[place] = distance
            on_shape(place + 1, len(numbers))
        return found

    def _distances(self, numbers: Int64[np.ndarray, " n"]) -> Iterator[float]:
        rest: int | None = None
        distance: ChamferTo | None = None
        for number in numbers.tolist():
            if distance is None or self._rests[number] != rest:
                rest = int(self._rests[number])
                distance = ChamferTo(self._clouds[rest])
            yield distance(self._clouds[int(self._rows[number])])


def spread(count: int, most: int) -> Int64[np.ndarray, "_"]:
    """Return at most so many of `count` numbers from 0, evenly spread, all different."""
    chosen = min(count, most)
    return ((2 * np.arange(chosen) + 1) * count // (2 * max(chosen, 1))).astype(np.int64)
