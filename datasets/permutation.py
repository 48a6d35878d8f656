"""A random order of any number of things, of which each part is computed when it is asked for."""

import numpy as np
from jaxtyping import Int64, UInt64

ROUNDS = 6

Numbers = Int64[np.ndarray, "_"]
_Words = UInt64[np.ndarray, "_"]


class Permutation:
    """A permutation of 0 to `count` - 1, a pure function of its arguments, held in no memory.

    A Feistel network (Luby and Rackoff 1988) permutes the numbers below a power of four; those
    that land beyond `count` go through it again until they do not (Black and Rogaway 2002).

    Args:
        count: How many numbers.
        seed: Non-negative numbers; others give another order.
    """

    def __init__(self, count: int, *, seed: tuple[int, ...]) -> None:
        self.count = count
        self._half = np.uint64(max(1, (max(count - 1, 1).bit_length() + 1) // 2))
        self._mask = np.uint64((1 << int(self._half)) - 1)
        self._keys = np.random.SeedSequence(seed).generate_state(ROUNDS, np.uint64)

    def __len__(self) -> int:
        return self.count

    def part(self, start: int, stop: int) -> Numbers:
        """Return what stands at the places from `start` to `stop` of the order."""
        stop = min(stop, self.count)
        return self.at(np.arange(min(start, stop), stop, dtype=np.int64))

    def at(self, places: Numbers) -> Numbers:
        """Return what stands at `places`, each from 0 to `count` - 1."""
        numbers = self._shuffled(places.astype(np.uint64))
        while True:
            beyond = np.flatnonzero(numbers >= self.count)
            if not len(beyond):
                return numbers.astype(np.int64)
            numbers[beyond] = self._shuffled(numbers[beyond])

    def _shuffled(self, numbers: _Words) -> _Words:
        left, right = numbers >> self._half, numbers & self._mask
        for key in self._keys:
            left, right = right, left ^ (_mixed(right ^ key) & self._mask)
        return (left << self._half) | right


def _mixed(words: _Words) -> _Words:
    """Return words each of whose bits depends on all bits (the finalizer of SplitMix64).

    Steele, Lea and Flood 2014, with the constants of Stafford's variant 13.
    """
    words = (words ^ (words >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    words = (words ^ (words >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return words ^ (words >> np.uint64(31))
