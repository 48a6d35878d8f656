"""A dataset parted into two folders, as a training parts it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import polars as pl

from dnet.datasets.frame_table import SETTLED
from dnet.datasets.index import Index
from dnet.datasets.split import split
from dnet.errors import TooFew
from dnet.tools.placing import place_episodes, refuse_occupied

SIDES = ("training", "validation")


@dataclass(frozen=True, slots=True)
class Side:
    """One of the two folders."""

    folder: Path
    episodes: int
    shapes: int


def split_dataset(
    index: Index,
    out: Path,
    *,
    fraction: float,
    seed: int,
    copy: bool = False,
    on_file: Callable[[int, int], None] = lambda _done, _total: None,
) -> tuple[Side, Side]:
    """Put the episodes to learn from and those to judge by into folders of their own.

    The sides are those that `dnet train` makes with the same fraction and seed. It goes by the
    episodes with two settled frames or more; one with fewer has no pair to judge a network by, and
    lies with those to learn from.

    Args:
        index: Of a dataset in a folder; files that cannot be read are left out.
        out: Gets the folders `training` and `validation`.
        fraction: How much to validate on, from 0 to 1.
        seed: Another seed, another split.
        copy: Copy the files instead of linking them.
        on_file: Called with the number of files of a side that are there and of all of that side.

    Raises:
        NotAFraction: If `fraction` is not from 0 to 1.
        TooFew: If fewer than two episodes have a pair of settled frames.
        OccupiedOutput: If one of the folders already holds episodes.
        Unwritten: If nothing can be written there.
    """
    readable = index.files.filter(index.files["note"] == "")
    ids = _paired(index)
    _, judged = split(ids, fraction=fraction, seed=seed)
    if len(ids) < 2:
        raise TooFew(f"number of episodes in {index.root} with two settled frames", len(ids), 2)
    for name in SIDES:
        refuse_occupied(out / name)
    sides = []
    for name in SIDES:
        own = readable.filter(readable["episode"].is_in(judged) == (name == SIDES[1]))
        files = {file: Path(index.path(file)) for file in own["name"]}
        place_episodes(files, out / name, copy=copy, on_file=on_file)
        sides.append(Side(out / name, own.height, int(own["shapes"].sum())))
    return sides[0], sides[1]


def _paired(index: Index) -> list[str]:
    """Return the ids of the episodes of which a network can learn a motion."""
    settled = index.frames.filter(pl.col("kind").is_in(SETTLED))
    paired = settled.group_by("name", "episode").len().filter(pl.col("len") > 1)
    return paired["episode"].unique().sort().to_list()
