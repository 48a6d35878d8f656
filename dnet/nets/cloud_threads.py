"""Working on the clouds of a batch on as many threads as torch uses."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise
from typing import TypeVar

import torch

Result = TypeVar("Result")


def for_all_clouds(work: Callable[[int, int], Result], count: int) -> list[Result]:
    """Return `work(first, last)` of parts that make up `count` clouds, done at the same time.

    Each cloud must be done by itself, so that it does not matter how many threads there are.
    With one thread, or for one cloud, no thread is started or woken.
    """
    parts = min(torch.get_num_threads(), count)
    if parts <= 1:
        return [work(0, count)]
    ends = [part * count // parts for part in range(parts + 1)]
    pool = _threads(parts - 1)
    others = [pool.submit(work, first, last) for first, last in pairwise(ends[1:])]
    return [work(0, ends[1]), *(other.result() for other in others)]


@cache
def _threads(count: int) -> ThreadPoolExecutor:
    return ThreadPoolExecutor(count, thread_name_prefix="clouds")


# A forked process has none of its parent's threads.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_threads.cache_clear)
