"""`dnet inspect filter`: the frames for which a condition holds."""

from dataclasses import dataclass
from pathlib import Path

import tyro


@dataclass(frozen=True)
class Filter:
    """Find the frames for which a condition holds, and make a dataset of their episodes.

    The condition is SQL on the columns of the index: episode, frame, kind, time, grasp_x,
    motion_x and so on in metres, motion_mm, points, and of the object young, size_x, object.

    Example: dnet inspect filter data/box "kind = 'shape' and motion_mm > 60" --episodes
    """

    directory: tyro.conf.Positional[Path]
    """A directory of episodes; it stays as it is."""
    condition: tyro.conf.Positional[str]
    """True or false of each frame."""
    episodes: tyro.conf.FlagCreatePairsOff[bool] = False
    """Print a row an episode, with how many of its frames match, instead of a row a frame."""
    limit: int = 50
    """Rows to print; the last line says how many there are. Machines get all."""
    out: Path | None = None
    """Make a dataset of the episodes that have a matching frame, by links where the disk allows."""
    csv: tyro.conf.FlagCreatePairsOff[bool] = False
    """Print comma-separated values instead of a table."""
    json: tyro.conf.FlagCreatePairsOff[bool] = False
    """Print a JSON list of objects instead of a table."""

    def run(self) -> None:
        """Print what matches.

        Raises:
            DnetError: If there are no episodes, the condition is none, or the output directory
                will not do or would get no episode.
        """
        from rich.console import Console

        from dnet.commands.index_bar import read_index
        from dnet.errors import NothingMatches, TooFew
        from dnet.tools.filtering import episodes_of, matching_frames
        from dnet.tools.placing import place_episodes
        from dnet.tools.tables import print_frame

        if self.limit < 1:
            raise TooFew("--limit", self.limit, 1)
        index = read_index(self.directory, Console(stderr=True))
        frames = matching_frames(index, self.condition)
        matching = episodes_of(frames)
        if self.out is not None:
            if not matching.height:
                raise NothingMatches(self.directory, self.condition, index.frames.height)
            place_episodes({name: self.directory / name for name in matching["name"]}, self.out)
        rows = matching if self.episodes else frames
        if self.csv or self.json:
            print_frame(rows, "csv" if self.csv else "json")
            return
        shown = rows.head(self.limit)
        print_frame(shown.drop("name") if self.episodes else shown.select(_SHOWN), "table")
        print(
            f"{frames.height} of {index.frames.height} frames, in {matching.height} of "
            f"{index.files.height} episodes"
            + (f"; the first {self.limit} rows" if rows.height > self.limit else "")
            + (f"; those episodes are in {self.out}" if self.out is not None else "")
        )


_SHOWN = ["episode", "frame", "kind", "time", "motion_mm", "motion_x", "motion_y", "motion_z"]
