"""Memory that C code asks for, measured step by step."""

import ctypes
from pathlib import Path

import pytest

from tests.endurance.figures import measure

LOT = 1 << 26
"""Bytes: more than anything else that may come and go meanwhile."""


def ask_and_give_back(folder: str) -> None:
    c = ctypes.CDLL(None)
    c.malloc.restype = ctypes.c_void_p
    c.malloc.argtypes = [ctypes.c_size_t]
    c.free.argtypes = [ctypes.c_void_p]
    place = Path(folder)
    measure(place, number=0, hours=0.0)  # measuring takes some memory, the first time
    before = measure(place, number=0, hours=0.0)
    block = c.malloc(LOT)
    held = measure(place, number=1, hours=0.1)
    assert held.heap - before.heap == pytest.approx(LOT, rel=0.1)
    # Nothing was written there: it is not in RAM.
    assert held.anonymous - before.anonymous < LOT / 2
    ctypes.memset(block, 1, LOT)
    full = measure(place, number=2, hours=0.2)
    assert full.anonymous - before.anonymous == pytest.approx(LOT, rel=0.1)
    c.free(block)
    after = measure(place, number=3, hours=0.3)
    for name in ("heap", "anonymous"):
        assert getattr(after, name) - getattr(before, name) < LOT / 10
