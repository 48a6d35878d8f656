"""What grows is called so, what stays is flat, and what cannot be told is undecided."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from tests.endurance.figures import Figures
from tests.endurance.trend import COUNT_RISE, MEMORY_RISE, WARM_UP, settled, trend

ROUND = Figures(
    round=0,
    hours=0.0,
    rss=1,
    anonymous=1,
    heap=1,
    objects=1,
    handles=24,
    threads=20,
    processes=2,
    disk=0,
    files=3,
)


def rounds(memory: Callable[[float], float], *, hours: float = 2.0) -> list[Figures]:
    times = np.linspace(0, hours, 100).tolist()
    return [
        replace(ROUND, round=number, hours=time, anonymous=int(1e6 * memory(time)))
        for number, time in enumerate(times)
    ]


def test_memory_that_stays_is_flat_however_it_trembles() -> None:
    random = np.random.default_rng(0)
    found = trend(rounds(lambda _: 500 + random.normal(scale=3)), "anonymous")
    assert found.verdict == "flat"
    assert abs(found.rise) < found.error * 2


def test_a_leak_of_twice_the_bound_is_found_under_the_trembling() -> None:
    random = np.random.default_rng(0)
    leak = 2 * MEMORY_RISE * 500
    found = trend(rounds(lambda time: 500 + leak * time + random.normal(scale=3)), "anonymous")
    assert found.verdict == "grows"
    assert abs(found.rise / 1e6 - leak) < found.error / 1e6


def test_a_run_too_short_to_tell_says_so() -> None:
    random = np.random.default_rng(0)
    short = rounds(lambda _: 500 + random.normal(scale=30), hours=0.1)
    assert trend(short, "anonymous").verdict == "undecided"


def test_a_warm_up_is_no_leak() -> None:
    found = trend(rounds(lambda time: 500.0 if time > 0.15 else 300.0), "anonymous")
    assert found.verdict == "flat"
    assert len(settled(rounds(lambda _: 1.0))) == 100 - WARM_UP
    assert len(settled(rounds(lambda _: 1.0)[:12])) == 9


def test_what_never_changes_is_flat_and_a_thread_an_hour_is_not() -> None:
    assert trend(rounds(lambda _: 1.0), "threads").verdict == "flat"
    assert trend(rounds(lambda _: 1.0), "disk").verdict == "flat"
    more = [replace(one, threads=20 + int(one.hours * 4)) for one in rounds(lambda _: 1.0)]
    assert trend(more, "threads").verdict == "grows"
    assert trend(more, "threads").rise > COUNT_RISE
