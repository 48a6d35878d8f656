"""One dataset out of several."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import polars as pl

from dnet.datasets.index import Index
from dnet.errors import BadEpisode, ClashingEpisodes, NoEpisodes
from dnet.tools.placing import place_episodes


@dataclass(frozen=True, slots=True)
class Merged:
    """What became of the episodes of several datasets."""

    episodes: int
    """In the new folder."""
    repeated: tuple[str, ...]
    """Files that another folder holds too, byte for byte; each is taken once."""
    broken: tuple[str, ...]
    """Files that cannot be read, and were left out."""


def merge_datasets(
    indexes: Sequence[Index],
    out: Path,
    *,
    skip_broken: bool = False,
    copy: bool = False,
    on_file: Callable[[int, int], None] = lambda _done, _total: None,
) -> Merged:
    """Put the episodes of several folders into a new one.

    An id tells an episode from all others of a dataset, and a split goes by it: two different
    episodes of one id cannot be in one folder, and no renaming of files would help.

    Args:
        indexes: Of datasets in folders.
        out: The new folder.
        skip_broken: Leave files out that cannot be read, instead of refusing them.
        copy: Copy the files instead of linking them.
        on_file: Called with the number of files that are there and of all.

    Raises:
        BadEpisode: If a file cannot be read.
        NoEpisodes: If none can, and such files are left out.
        ClashingEpisodes: If two different episodes have one id, or two files one name.
        OccupiedOutput: If the new folder already holds episodes.
        Unwritten: If nothing can be written there.
    """
    files = pl.concat(
        [
            index.files.with_columns(
                path=pl.Series(
                    [str(index.path(name)) for name in index.files["name"]], dtype=pl.String
                )
            )
            for index in indexes
        ]
    ).with_row_index("row")
    broken = files.filter(pl.col("note") != "")
    if broken.height and not skip_broken:
        path, why = broken.select("path", "note").row(0)
        raise BadEpisode(Path(path), why, "repair or remove it, or leave such files out")
    readable = files.filter(pl.col("note") == "")
    if not readable.height:
        raise NoEpisodes(indexes[0].root, "holds no .mcap episode that can be read")
    single = readable.unique("sha256", keep="first", maintain_order=True)
    for column in ("episode", "name"):
        clash = single.filter(pl.col(column).is_duplicated()).sort(column, maintain_order=True)
        if clash.height:
            raise ClashingEpisodes(column, clash[column][0], clash["path"][:2].to_list())
    sources = {name: Path(path) for name, path in single.select("name", "path").iter_rows()}
    place_episodes(sources, out, copy=copy, on_file=on_file)
    # By row and not by path: somebody may give one folder twice.
    repeated = readable.filter(~pl.col("row").is_in(single["row"].to_list()))
    return Merged(single.height, tuple(repeated["path"]), tuple(broken["path"]))
