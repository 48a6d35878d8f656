"""Whether what was held grows: a line through the rounds, and how far it may rise."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.stats import linregress, t

from tests.endurance.figures import Figures

WARM_UP = 10
"""Rounds that no line goes through: caches fill, the allocator finds its size. Of a run of fewer
than 40 it is a quarter."""
CONFIDENCE = 0.95

MEMORY_RISE = 0.02
"""Of memory in RAM, an hour, as a share of its median: the allocator keeps now more, now less."""
HEAP_RISE = 0.005
"""Of what C code has asked for and not given back; that hardly varies, so that less is seen."""
OBJECTS_RISE = 0.005
"""Of Python's objects, likewise."""
DISK_RISE = 0.005
"""Of bytes and files on the disk, likewise."""
COUNT_RISE = 0.5
"""Of handles, threads and processes, an hour: not one of them in two hours."""

SHARES = {
    "rss": MEMORY_RISE,
    "anonymous": MEMORY_RISE,
    "heap": HEAP_RISE,
    "objects": OBJECTS_RISE,
    "disk": DISK_RISE,
    "files": DISK_RISE,
}
COUNTS = {"handles": COUNT_RISE, "threads": COUNT_RISE, "processes": COUNT_RISE}
NAMES = (*SHARES, *COUNTS)

Verdict = Literal["flat", "grows", "undecided"]


@dataclass(frozen=True, slots=True)
class Trend:
    """A line through one column of the figures after the warm-up."""

    name: str
    median: float
    first: float
    """The lowest and the highest value are of these rounds too."""
    last: float
    lowest: float
    highest: float
    rise: float
    """Of the line, an hour."""
    error: float
    """Half the width of the interval that the rise lies in with `CONFIDENCE`."""
    bound: float
    """The most that it may rise an hour."""

    @property
    def verdict(self) -> Verdict:
        """`flat`: the rise is below the bound for certain; `grows`: above it for certain."""
        if self.rise + self.error <= self.bound:
            return "flat"
        return "grows" if self.rise - self.error > self.bound else "undecided"


def settled(rows: Sequence[Figures]) -> Sequence[Figures]:
    """Return the rounds after the warm-up."""
    return rows[min(WARM_UP, len(rows) // 4) :]


def trend(rows: Sequence[Figures], name: str) -> Trend:
    """Fit a line to one column, three rounds after the warm-up at least.

    Args:
        rows: All rounds.
        name: Of the column.
    """
    rounds = settled(rows)
    hours = np.array([row.hours for row in rounds])
    values = np.array([float(getattr(row, name)) for row in rounds])
    rise, error = 0.0, 0.0
    if np.ptp(values):  # SciPy knows no error of a line through equal values
        line = linregress(hours, values)
        rise = float(line.slope)
        error = float(line.stderr) * float(t.ppf((1 + CONFIDENCE) / 2, len(rounds) - 2))
    median = float(np.median(values))
    return Trend(
        name=name,
        median=median,
        first=float(values[0]),
        last=float(values[-1]),
        lowest=float(values.min()),
        highest=float(values.max()),
        rise=rise,
        error=error,
        bound=SHARES[name] * median if name in SHARES else COUNTS[name],
    )
