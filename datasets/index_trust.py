"""Whether a stored index can be true of the logs beside it: it may come from anybody.

What it says becomes lengths of arrays, places in files and names of tables. It is no proof that the
index is right, only that nothing it says leads out of the logs that it is of.
"""

from collections.abc import Iterable

import polars as pl

from dnet.datasets.index_rows import AXES

MOST_REMOVED = 10_000
"""Files that an index may have beyond those that are still there; then it is made anew."""
SHARE, SPARE = 4, 16 * 2**20
"""An index may have a quarter of the bytes of its logs, and so many more; it has a hundredth."""
POINT = 12
"""Bytes of a point."""

_DIGEST = r"^[0-9a-f]{64}$"


def most_bytes(sizes: Iterable[int]) -> int:
    """Return how many bytes an index of logs of these sizes may have."""
    return sum(sizes) // SHARE + SPARE


def believable(files: pl.DataFrame, frames: pl.DataFrame) -> bool:
    """Return whether all that the rows say lies within the files that they are of.

    Args:
        files: Rows of files, whose bytes are known to be right.
        frames: Rows of their frames.
    """
    named = files["name"].is_unique().all()
    broken = pl.col("note") != ""
    sizes = ("seconds", "size_x", "size_y", "size_z", "young")
    told = files.select(
        pl.col("note", "shapes", "finished").is_not_null(),
        pl.col("sha256").str.contains(_DIGEST) | (broken & pl.col("sha256").is_null()),
        *(pl.col(name).is_not_null() | broken for name in ("episode", "object", "scene")),
        *(pl.col(name).is_finite() | broken for name in sizes),
    )
    return bool(named) and _all(told) and _all(_within(files, frames))


def _within(files: pl.DataFrame, frames: pl.DataFrame) -> pl.DataFrame:
    joined = frames.join(files.select("name", "bytes"), on="name", how="left")
    size, numbers = (
        pl.col("bytes"),
        [f"{what}_{axis}" for what in ("grasp", "motion") for axis in AXES],
    )
    points = POINT * pl.col("points").cast(pl.Int64)
    return joined.select(
        points=(points >= 0),
        chunk=pl.col("chunk").is_between(0, size),
        length=pl.col("length").is_between(1, size - pl.col("chunk")),
        message=pl.col("message") >= 0,
        data=pl.col("data").is_null() | pl.col("data").is_between(0, size - points),
        **{name: pl.col(name).is_finite() for name in ("time", *numbers)},
    )


def _all(told: pl.DataFrame) -> bool:
    return all(told[name].fill_null(value=False).all() for name in told.columns)
