"""Parquet files written table by table, so that they may be longer than memory."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from threading import Event

import polars as pl
from polars.exceptions import ComputeError
from polars.io.plugins import register_io_source

ROWS_A_GROUP = 64
"""A reader takes in a whole group for one row of it: some MB of clouds."""


def write_table(table: pl.DataFrame, path: Path) -> None:
    """Write one table.

    Raises:
        OSError: If it cannot be written.
    """
    with _as_os_error():
        table.write_parquet(path, row_group_size=ROWS_A_GROUP)


def write_tables(tables: Iterator[pl.DataFrame], path: Path) -> None:
    """Write `tables`, of which there is at least one, all alike, below each other.

    The next is asked for, in another thread, when the one before it is no longer needed. After an
    error or Ctrl-C nothing is written any more.

    Raises:
        OSError: If they cannot be written.
    """
    # Polars makes the file some time later: from here on, others see that the name is taken.
    path.touch()
    first = next(tables)
    stopped = Event()

    def source(
        _columns: list[str] | None, _where: pl.Expr | None, _rows: int | None, _batch: int | None
    ) -> Iterator[pl.DataFrame]:
        yield first
        for table in tables:
            if stopped.is_set():
                raise InterruptedError
            yield table

    stream = register_io_source(source, schema=first.schema)
    # Ctrl-C in the thread that began it would return at once, and polars would write on.
    with ThreadPoolExecutor(1) as executor, _as_os_error():
        written = executor.submit(stream.sink_parquet, path, row_group_size=ROWS_A_GROUP)
        try:
            written.result()
        except BaseException:
            stopped.set()
            raise


@contextmanager
def _as_os_error() -> Iterator[None]:
    """Call what polars says of a full disk by the name that others have for it."""
    try:
        yield
    except ComputeError as error:
        raise OSError(str(error)) from error
