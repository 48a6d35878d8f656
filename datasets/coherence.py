"""What the episodes of a dataset must have in common, and what no two of them may."""

import polars as pl

from dnet.datasets.index import Index
from dnet.errors import BadEpisode


def refuse_doubles(index: Index, files: pl.DataFrame, *, way_out: str) -> None:
    """Do nothing if no two files hold one episode.

    Args:
        index: Of the dataset.
        files: Those of its files that count.
        way_out: What can be done about it, for the error.

    Raises:
        BadEpisode: If two of them have one id.
    """
    doubles = files.filter(pl.col("episode").is_duplicated()).sort("episode", "name")
    if doubles.height:
        first, second = doubles["name"][:2]
        why = f"holds the same episode as {first}: {doubles['episode'][0]}"
        raise BadEpisode(index.path(second), why, way_out)


def points_of_all(index: Index, frames: pl.DataFrame, *, way_out: str) -> int:
    """Return how many points every cloud has.

    Args:
        index: Of the dataset.
        frames: Those of its frames that count, one or more.
        way_out: What can be done about it, for the error.

    Raises:
        BadEpisode: If the clouds differ in it.
    """
    points = int(frames["points"][0])
    others = frames.filter(pl.col("points") != points)
    if others.height:
        name, number, got = others.select("name", "frame", "points").row(0)
        why = f"has a cloud of {got} points at frame {number}, the first episode's have {points}"
        raise BadEpisode(index.path(name), why, way_out)
    return points
