"""Some episodes of a dataset, picked by id, by number, or by what their frames are like."""

from collections.abc import Collection, Sequence

import polars as pl

from dnet.datasets.index import Index
from dnet.errors import NoSuchEpisode, NothingMatches
from dnet.tools.filtering import matching_frames


def pick_episodes(index: Index, wanted: Sequence[str]) -> Index:
    """Return what the index says of some episodes alone.

    Args:
        index: Of a dataset.
        wanted: Each the id of an episode, or the number of its pair: 3 is episode-0-00003, and
            episode-1-00003 too where two recordings lie in one folder.

    Raises:
        NoSuchEpisode: If the dataset has no such episode that can be read.
    """
    readable = index.files.filter(pl.col("note") == "")
    names: set[str] = set()
    for one in wanted:
        found = readable.filter((pl.col("episode") == one) | _is_number(one))["name"]
        if not len(found):
            raise NoSuchEpisode(index.root, one, readable["episode"].to_list())
        names.update(found)
    return _only(index, names)


def pick_where(index: Index, condition: str) -> Index:
    """Return what the index says of the episodes with a frame for which `condition` holds.

    Args:
        index: Of a dataset.
        condition: SQL as `dnet.tools.filtering.matching_frames` takes it.

    Raises:
        BadCondition: If it is no such condition.
        NothingMatches: If it holds for no frame.
    """
    found = matching_frames(index, condition)
    if not found.height:
        raise NothingMatches(index.root, condition, index.frames.height)
    return _only(index, found["name"].unique().to_list())


def _only(index: Index, names: Collection[str]) -> Index:
    chosen = pl.col("name").is_in(list(names))
    return Index(index.root, index.files.filter(chosen), index.frames.filter(chosen))


def _is_number(text: str) -> pl.Expr:
    # More digits than a column has room for are no number of a pair.
    if not (text.isascii() and text.isdigit() and len(text) < 19):
        return pl.lit(value=False)
    return pl.col("pair") == int(text)
