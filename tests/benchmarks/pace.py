"""How fast clouds are read: needs numpy alone, so that peers in another Python are paced alike."""

from collections.abc import Callable, Iterable, Sequence
from time import process_time
from typing import Any

REPEATS = 3
PATIENCE = 4.0
"""Seconds after which a slow reader has shown its speed."""


def sequential(read: Callable[[], Iterable[Any]]) -> float:
    """Return MB a CPU-second of reading clouds one after another, touching all their bytes."""
    speeds = []
    for _ in range(REPEATS):
        size, begin = 0, process_time()
        for cloud in read():
            cloud.max()
            size += cloud.nbytes
            if process_time() - begin > PATIENCE:
                break
        speeds.append(size / 1e6 / (process_time() - begin))
    return max(speeds)


def at_random(read: Callable[[int], Any], rows: Sequence[int]) -> float:
    """Return clouds a CPU-second of reading these ones, touching all their bytes."""
    speeds = []
    for _ in range(REPEATS):
        done, begin = 0, process_time()
        for row in rows:
            read(row).max()
            done += 1
            if process_time() - begin > PATIENCE:
                break
        speeds.append(done / (process_time() - begin))
    return max(speeds)
