"""How fast a recording was made: `timings.jsonl`, a line for each episode as it ended."""

import math
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

from dnet.files.sizes import LARGEST_JSON, parse_json, read_at_most

TIMINGS = "timings.jsonl"


@dataclass(frozen=True, slots=True)
class Pace:
    """Shapes in some hours."""

    hours: float
    shapes_per_second: float | None
    """None for no time at all."""


@dataclass(frozen=True, slots=True)
class Worker:
    """What one process recorded."""

    host: str
    worker: int
    """Number of the process on its host."""
    episodes: int
    shapes: int
    pace: Pace
    """By the clock on the wall, while it worked."""
    first_bytes: int | None
    """Resident memory after its first episode, None where nothing says it."""
    last_bytes: int | None
    """And after its last."""


@dataclass(frozen=True, slots=True)
class Speed:
    """How fast a recording was made, in all of its runs together."""

    episodes: int
    """That were timed; one that was recorded again counts again."""
    shapes: int
    unreadable_lines: int
    """Lines that were cut off when a recording was killed."""
    cpu: Pace
    """By the processors' time."""
    worker: Pace
    """By the clock on the wall, the workers' hours added up: the speed of one of them."""
    machine: Pace
    """By the clock on the wall, while any worker worked: the speed of all of them."""
    workers: tuple[Worker, ...]


class _Timing(NamedTuple):
    host: str
    worker: int
    shapes: int
    seconds: float
    cpu_seconds: float
    ended: float
    """Seconds since 1970."""
    memory: int | None
    """Resident bytes of the worker."""


def read_speed(directory: Path) -> Speed | None:
    """Return how fast the episodes of `directory` were recorded, None if nothing says it."""
    path = directory / TIMINGS
    if not path.is_file():
        return None
    content = read_at_most(path, LARGEST_JSON, what="timings")
    lines = content.decode("utf-8", errors="replace").splitlines()
    timings = [timing for timing in map(_read, lines) if timing is not None]
    if not timings:
        return None
    shapes = sum(timing.shapes for timing in timings)
    return Speed(
        episodes=len(timings),
        shapes=shapes,
        unreadable_lines=len(lines) - len(timings),
        cpu=_pace(shapes, sum(timing.cpu_seconds for timing in timings)),
        worker=_pace(shapes, sum(timing.seconds for timing in timings)),
        machine=_pace(shapes, _covered(timings)),
        workers=tuple(
            _worker(*process, [timing for timing in timings if timing[:2] == process])
            for process in sorted({timing[:2] for timing in timings})
        ),
    )


def _worker(host: str, number: int, timings: list[_Timing]) -> Worker:
    shapes = sum(timing.shapes for timing in timings)
    pace = _pace(shapes, sum(timing.seconds for timing in timings))
    first, last = timings[0].memory, timings[-1].memory
    return Worker(host, number, len(timings), shapes, pace, first_bytes=first, last_bytes=last)


def _pace(shapes: int, seconds: float) -> Pace:
    return Pace(seconds / 3600, shapes / seconds if seconds else None)


def _covered(timings: list[_Timing]) -> float:
    """Return the seconds that the episodes cover, those of several workers once."""
    covered, end = 0.0, -math.inf
    for start, stop in sorted((timing.ended - timing.seconds, timing.ended) for timing in timings):
        covered += max(0.0, stop - max(start, end))
        end = max(end, stop)
    return covered


def _read(line: str) -> _Timing | None:
    """Return what a line says, None if it was cut off."""
    try:
        record = parse_json(line)
        timing = _Timing(
            str(record["host"]) if "host" in record else "",
            int(record["worker"]),
            int(record["shapes"]),
            float(record["seconds"]),
            float(record["cpu_seconds"]),
            datetime.fromisoformat(record["ended"]).timestamp(),
            int(record["memory"]) if "memory" in record else None,
        )
    except (ValueError, TypeError, KeyError, OverflowError, OSError, RecursionError):
        return None
    # JSON knows NaN and Infinity where Python writes it.
    if not all(map(math.isfinite, timing[1:6])) or min(timing[2:5]) < 0:
        return None
    return timing
