"""Whether a stored index can be true of the logs beside it: it may come from anybody.

What it says becomes lengths of arrays, places in files and names of tables. It is no proof that the
index is right, only that nothing it says leads out of the logs that it is of.
"""

from collections.abc import Mapping
from io import BytesIO

import polars as pl

from dnet.datasets.index_rows import AXES

LEAST_FRAME = 100
"""Bytes of a log that each frame takes at least, for its seven messages have 16 in the index of
the log alone: a table of more frames than that is of other logs, or of none."""
MOST_REMOVED = 10_000
"""Files that an index may have beyond those that are still there; then it is made anew."""
SPARE = 16 * 2**20
"""Bytes that an index may have beyond those of its logs, which it is a hundredth of."""
POINT = 12
"""Bytes of a point."""

_DIGEST = r"^[0-9a-f]{64}$"


def worth_reading(files: bytes, frames: bytes, *, sizes: Mapping[str, int]) -> bool:
    """Return whether two tables have no more rows than the logs can account for.

    A table of a few bytes can claim any number of rows: it is asked before any is read.

    Args:
        files: The stored table of files.
        frames: The stored table of frames.
        sizes: Bytes of each log, by its name.

    Raises:
        PolarsError: If one of them is no table.
    """
    total = sum(sizes.values())
    return (
        len(files) + len(frames) <= total + SPARE
        and _height(files) <= len(sizes) + MOST_REMOVED
        and _height(frames) <= total // LEAST_FRAME
    )


def believable(files: pl.DataFrame, frames: pl.DataFrame) -> bool:
    """Return whether all that the rows say lies within the files that they are of.

    Args:
        files: Rows of files, whose bytes are known to be right.
        frames: Rows of their frames.
    """
    named = files["name"].is_unique().all()
    broken = pl.col("note") != ""
    told = files.select(
        digest=pl.col("sha256").str.contains(_DIGEST) | (broken & pl.col("sha256").is_null()),
        episode=pl.col("episode").is_not_null() | broken,
    )
    return bool(named) and _all(told) and _all(_within(files, frames))


def _within(files: pl.DataFrame, frames: pl.DataFrame) -> pl.DataFrame:
    joined = frames.join(files.select("name", "bytes", of="episode"), on="name", how="left")
    size, numbers = (
        pl.col("bytes"),
        [f"{what}_{axis}" for what in ("grasp", "motion") for axis in AXES],
    )
    points = POINT * pl.col("points").cast(pl.Int64)
    return joined.select(
        known=pl.col("episode") == pl.col("of"),
        numbered=pl.col("frame").cast(pl.Int64) == pl.int_range(pl.len()).over("name"),
        kind=pl.col("kind").is_not_null(),
        points=(points >= 0),
        chunk=pl.col("chunk").is_between(0, size),
        length=pl.col("length").is_between(1, size - pl.col("chunk")),
        message=pl.col("message") >= 0,
        data=pl.col("data").is_null() | pl.col("data").is_between(0, size - points),
        **{name: pl.col(name).is_finite() for name in ("time", *numbers)},
    )


def _all(told: pl.DataFrame) -> bool:
    return all(told[name].fill_null(value=False).all() for name in told.columns)


def _height(table: bytes) -> int:
    height: int = pl.scan_parquet(BytesIO(table)).select(pl.len()).collect().item()
    return height
