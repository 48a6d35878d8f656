"""Histograms with round bins, and how they look as text."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

SAME = 1e-9
"""Values closer than this share of themselves, or of 1, differ by rounding."""

_EIGHTHS = ("", "▏", "▎", "▍", "▌", "▋", "▊", "▉")
_HEIGHTS = " ▁▂▃▄▅▆▇█"


@dataclass(frozen=True, slots=True)
class Histogram:
    """How many values lie in each bin; bins are equally wide and none is left out between."""

    start: float
    """Where the first bin begins, a whole number of widths from zero."""
    width: float
    """Of each bin: 1, 2 or 5 times a power of ten."""
    counts: tuple[int, ...]
    """Values from `start + i * width` up to, but without, the next bin's start."""


def histogram(values: Float64[np.ndarray, "_"], *, most: int = 25) -> Histogram:
    """Return the histogram of `values` with the narrowest round bins of which `most` suffice.

    Values that are the same but for rounding get bins of width 1; no values give no bins.

    Args:
        values: Finite ones.
        most: At least two: zero is always between bins.
    """
    if not len(values):
        return Histogram(0.0, 1.0, ())
    low, high = float(values.min()), float(values.max())
    width = _width(low, high, most)
    first = math.floor(low / width)
    places = np.floor(values / width).astype(np.int64) - first
    return Histogram(first * width, width, tuple(np.bincount(places).tolist()))


def _width(low: float, high: float, most: int) -> float:
    if high - low <= SAME * max(1.0, abs(low), abs(high)):
        return 1.0
    power = math.floor(math.log10((high - low) / most))
    while True:
        # Powers below one by division: 0.1 is exact to rounding, 10 ** -1 times 2 need not be.
        for step in (1, 2, 5):
            width = step * 10.0**power if power >= 0 else step / 10.0**-power
            if math.floor(high / width) - math.floor(low / width) < most:
                return width
        power += 1


def bar(count: int, largest: int, *, length: int = 40) -> str:
    """Return a bar that is `length` characters long for the largest count, to an eighth of one.

    A count above zero is always seen.
    """
    if count == 0:
        return ""
    eighths = max(1, round(8 * length * count / largest))
    return "█" * (eighths // 8) + _EIGHTHS[eighths % 8]


def skyline(counts: tuple[int, ...]) -> str:
    """Return one character a bin, as high as its count; only an empty bin is blank."""
    largest = max([*counts, 1])
    top = len(_HEIGHTS) - 1
    return "".join(_HEIGHTS[math.ceil(top * count / largest)] for count in counts)
