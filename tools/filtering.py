"""The frames of a dataset for which a condition holds."""

import polars as pl
from polars.exceptions import PolarsError

from dnet.datasets.index import Index
from dnet.errors import BadCondition

PLACES = ("chunk", "length", "message", "data", "content")
"""Columns of the index that say where a cloud lies, and nothing of what it is like."""
OF_FILES = ("seed", "pair", "object", "size_x", "size_y", "size_z", "young", "finished")
"""Columns of the files that each of their frames gets."""


def matching_frames(index: Index, condition: str) -> pl.DataFrame:
    """Return the frames for which a condition holds, with what is known of their episodes.

    Args:
        index: Of a dataset.
        condition: SQL that is true or false of a frame, such as "kind = 'shape' and motion_mm >
            30". It is parsed, not run: it can do nothing but compare.

    Raises:
        BadCondition: If it is no such condition.
    """
    frames = described_frames(index)
    try:
        return frames.filter(pl.sql_expr(condition))
    except PolarsError as error:
        why = str(error).partition("\n")[0].partition("; valid columns")[0]
        raise BadCondition(condition, why, frames.columns) from error


def described_frames(index: Index) -> pl.DataFrame:
    """Return the columns that a condition can be on.

    Those of the index but for where clouds lie, `motion_mm` (the length of the motion), and what
    is known of the object.
    """
    motion = sum((pl.col(f"motion_{axis}") ** 2 for axis in "xyz"), start=pl.lit(0.0)).sqrt()
    return (
        index.frames.drop(PLACES)
        .with_columns(motion_mm=1e3 * motion)
        .join(index.files.select("name", *OF_FILES), on="name", maintain_order="left")
    )


def episodes_of(frames: pl.DataFrame) -> pl.DataFrame:
    """Return a row for each episode that has some of `frames`, with how many it has."""
    return frames.group_by("name", "episode", maintain_order=True).agg(
        pl.len().alias("frames"),
        pl.col("motion_mm").mean().alias("mean_mm"),
        pl.col("motion_mm").max().alias("greatest_mm"),
    )
