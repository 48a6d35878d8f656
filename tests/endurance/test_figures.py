"""What is measured is what is held: what was asked for counts, and what was given back does not."""

import ctypes
from pathlib import Path

import pytest

from tests.endurance.figures import Table, measure, read_table

LOT = 1 << 26
"""Bytes: more than anything else that may come and go meanwhile."""


@pytest.fixture
def c() -> ctypes.CDLL:
    library = ctypes.CDLL(None)
    library.malloc.restype = ctypes.c_void_p
    library.malloc.argtypes = [ctypes.c_size_t]
    library.free.argtypes = [ctypes.c_void_p]
    return library


def test_what_c_code_asks_for_counts_until_it_is_given_back(c: ctypes.CDLL, tmp_path: Path) -> None:
    measure(tmp_path, number=0, hours=0.0)  # measuring takes some memory, the first time
    before = measure(tmp_path, number=0, hours=0.0)
    block = c.malloc(LOT)
    held = measure(tmp_path, number=1, hours=0.1)
    assert held.heap - before.heap == pytest.approx(LOT, rel=0.1)
    # Nothing was written there: it is not in RAM.
    assert held.anonymous - before.anonymous < LOT / 2
    ctypes.memset(block, 1, LOT)
    full = measure(tmp_path, number=2, hours=0.2)
    assert full.anonymous - before.anonymous == pytest.approx(LOT, rel=0.1)
    c.free(block)
    after = measure(tmp_path, number=3, hours=0.3)
    for name in ("heap", "anonymous"):
        assert getattr(after, name) - getattr(before, name) < LOT / 10


def test_a_table_is_read_as_it_was_written(tmp_path: Path) -> None:
    path = tmp_path / "figures.csv"
    table = Table(path)
    table.add(measure(tmp_path, number=0, hours=0.25))
    assert read_table(path) == table.rows
    table.close()
