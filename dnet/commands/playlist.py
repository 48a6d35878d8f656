"""Which recordings `dnet play` shows: the files that it was given, and the episodes of folders."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

    from dnet.datasets.index import Index
    from dnet.types import Place


RECORDINGS = ("run.rrd", "training.rrd", "grasp.rrd", "run.mcap")
"""What the directories of `dnet servo`, `train` and `evaluate grasp` hold for the viewer, the
best first."""


@dataclass(frozen=True)
class Choice:
    """Which episodes of a folder are wanted; files that are named are wanted anyhow."""

    episodes: Sequence[str] = field(default_factory=tuple)
    """Ids and numbers; none for all."""
    condition: str | None = None
    """SQL that must hold for one frame of theirs at least."""
    limit: int = 20
    """At most so many of each folder."""


def playlist(places: "Sequence[Place]", choice: Choice, console: "Console") -> "list[Place]":
    """Return the files to play, in the order of `places`, those of a folder by name.

    What is left out of a folder is said in a line on `console`.

    Raises:
        TooFew: If the limit is below one.
        UnusedOption: If episodes are to be chosen, and there is no folder.
        DnetError: If a folder has no episode, or none that is wanted.
    """
    from dnet.commands.index_bar import read_index
    from dnet.datasets.stores import as_place
    from dnet.errors import TooFew, UnusedOption

    if choice.limit < 1:
        raise TooFew("--limit", choice.limit, 1)
    known = [_recording(as_place(place)) for place in places]
    folders = [place for place in known if _is_folder(place)]
    option = "--episode" if choice.episodes else "--filter" if choice.condition else None
    if option is not None and not folders:
        raise UnusedOption(option, "a directory")
    files: list[Place] = []
    for place in known:
        if place in folders:
            files += _chosen(read_index(place, console), choice, console)
        else:
            files.append(place)
    return files


def side_by_side(places: "Sequence[Place]") -> "list[Place] | None":
    """Return the episodes of servo runs if nothing but directories of two or more is given."""
    runs = [Path(place) / "run.mcap" for place in places]
    if len(runs) < 2 or not all(run.is_file() for run in runs):
        return None
    return list(runs)


def _recording(place: "Place") -> "Place":
    """Return the recording of a run, or the place itself if it is no directory of a run."""
    if isinstance(place, Path):
        for name in RECORDINGS:
            if (place / name).is_file():
                return place / name
    return place


def _is_folder(place: "Place") -> bool:
    if isinstance(place, Path):
        return place.is_dir()
    return not place.endswith((".mcap", ".rrd", ".part"))


def _chosen(index: "Index", choice: Choice, console: "Console") -> "list[Place]":
    from dnet.errors import NoEpisodes
    from dnet.tools.picking import pick_episodes, pick_where

    if choice.episodes:
        index = pick_episodes(index, choice.episodes)
    if choice.condition is not None:
        index = pick_where(index, choice.condition)
    broken = index.broken()
    names = [name for name in index.files["name"] if name not in set(broken["name"])]
    if not names:
        raise NoEpisodes(index.root, "holds no .mcap episode that can be read")

    def say(line: str) -> None:
        console.print(line, markup=False, highlight=False, soft_wrap=True)

    if broken.height:
        name, why = broken.select("name", "note").row(0)
        more = f" and {broken.height - 1} more" if broken.height > 1 else ""
        say(f"left out: {name} {why}{more}; `dnet inspect ls {index.root}` lists them")
    if len(names) > choice.limit:
        say(
            f"the first {choice.limit} of {len(names)} episodes of {index.root}; "
            f"--limit {len(names)} opens all, --episode and --filter choose others"
        )
    return [index.path(name) for name in names[: choice.limit]]
