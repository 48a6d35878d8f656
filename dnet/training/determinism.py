"""Sums in the same order every time, so that a training repeats to the last bit."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import torch


@contextmanager
def repeatable() -> Iterator[None]:
    """Have torch compute the same bits each time while the context lasts, on as many threads.

    Else derivatives of rows that are taken several times are added up by whichever thread comes
    first. It takes no longer. What torch cannot repeat, on some GPUs, it warns of.
    """
    enabled = torch.are_deterministic_algorithms_enabled()
    warns = torch.is_deterministic_algorithms_warn_only_enabled()
    memory: Any = torch.utils.deterministic
    filled = memory.fill_uninitialized_memory
    torch.use_deterministic_algorithms(True, warn_only=True)
    # That is for finding mistakes, and takes time.
    memory.fill_uninitialized_memory = False
    try:
        yield
    finally:
        torch.use_deterministic_algorithms(enabled, warn_only=warns)
        memory.fill_uninitialized_memory = filled
