"""A dataset parted into two folders, as a training parts it."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from dnet.datasets.index import Index
from dnet.datasets.split import split
from dnet.errors import TooFew
from dnet.tools.placing import place_episodes

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

    An episode's side depends on the hash of its id alone, so the sides are those that `dnet train`
    makes with the same fraction and seed.

    Args:
        index: Of a dataset in a folder; files that cannot be read are left out.
        out: Gets the folders `training` and `validation`.
        fraction: How much to validate on, from 0 to 1.
        seed: Another seed, another split.
        copy: Copy the files instead of linking them.
        on_file: Called with the number of files of a side that are there and of all of that side.

    Raises:
        NotAFraction: If `fraction` is not from 0 to 1.
        TooFew: If there are fewer than two episodes.
        OccupiedOutput: If one of the folders already holds episodes.
        Unwritten: If nothing can be written there.
    """
    readable = index.files.filter(index.files["note"] == "")
    ids = sorted(set(readable["episode"]))
    if len(ids) < 2:
        raise TooFew(f"number of episodes in {index.root}", len(ids), 2)
    learned, _ = split(ids, fraction=fraction, seed=seed)
    sides = []
    for name in SIDES:
        own = readable.filter(readable["episode"].is_in(learned) == (name == SIDES[0]))
        files = {file: Path(index.path(file)) for file in own["name"]}
        place_episodes(files, out / name, copy=copy, on_file=on_file)
        sides.append(Side(out / name, own.height, int(own["shapes"].sum())))
    return sides[0], sides[1]
