"""`dnet play`: recordings in the Rerun viewer, as a picture, or as a file for another machine."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

if TYPE_CHECKING:
    from rich.console import Console


@dataclass(frozen=True)
class Play:
    """Play episodes and servo runs back in Rerun, or draw a picture of one without a screen.

    The view shows the object (blue), both arms, and curves of shape distance, motion, gripper and
    joints. A servo run shows its goal (green), each point in the colour of its distance from that,
    the motion that was asked for (arrow) and the true one (white). A recording shows its rest
    shape (grey) and how far the grasp has moved since (arrow).

    Two directories of `dnet servo`, or more, are shown side by side in one view.

    A directory of episodes opens all of them, each under its id in the list at the left of the
    window. --episode and --filter choose among them: --filter opens the episodes with a frame for
    which a condition holds, and takes SQL as `dnet inspect filter` does.

    Example: dnet play data/box --episode 3,7 --episode episode-0-00012

    Example: dnet play data/box --filter "kind = 'shape' and motion_mm > 80"

    Example: dnet play runs/servo --screenshot run.png

    Example: dnet play runs/servo --film run.webp

    Example: dnet play eval/deformernet/random-7 eval/oracle/random-7
    """

    files: Annotated[
        tyro.conf.Positional[tuple[str | Path, ...]], tyro.conf.arg(metavar="FILE|DIRECTORY|URL")
    ]
    """Episodes (`.mcap`) and runs (`.rrd`), unfinished ones (`.part`) too, directories of
    episodes, and those of `dnet servo` and `dnet train`."""
    episode: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(metavar="ID")] = ()
    """Of a directory, open these alone: ids, or numbers of pairs; with commas or repeated."""
    filter: Annotated[str | None, tyro.conf.arg(metavar="SQL")] = None
    """Of a directory, open the episodes with a frame for which this holds."""
    limit: int = 20
    """Of each directory, open so many episodes at most; the rest is said in a line."""
    screenshot: Path | None = None
    """Draw the first of them into this PNG instead of opening a window."""
    film: Path | None = None
    """Draw a servo run at every step, from its MCAP log alone, into this .webp or .gif, which
    moves; a run of `dnet servo --waypoints 3` has a step every few millimetres."""
    save: Path | None = None
    """Write all of them as one Rerun recording (`.rrd`) instead of opening a window."""
    at: float | None = None
    """When to draw the picture, in seconds of simulation; left out, the end of a servo run, or
    a recording's largest motion."""

    def run(self) -> None:
        """Show the recordings, with a progress bar while they are made ready.

        Raises:
            DnetError: If one of them is missing or unreadable, or none is chosen.
        """
        from rich.console import Console

        from dnet.commands.index_bar import reading
        from dnet.commands.playlist import Choice, playlist, side_by_side
        from dnet.datasets.reader import EpisodeReader
        from dnet.recorders.playback import play

        console = Console(stderr=True)
        if self.film is not None:
            self._film(self.film, console)
            return
        wanted = [one.strip() for some in self.episode for one in some.split(",") if one.strip()]
        beside = None if wanted or self.filter else side_by_side(self.files)
        choice = Choice(wanted, self.filter, self.limit)
        play(
            beside or playlist(self.files, choice, console),
            beside=beside is not None,
            open_episode=EpisodeReader,
            screenshot=self.screenshot,
            save=self.save,
            seconds=self.at,
            watched=reading(console),
        )
        for written in (self.screenshot, self.save):
            if written is not None:
                print(written)

    def _film(self, out: Path, console: "Console") -> None:
        """Draw the first of the runs as a film, with a progress bar."""
        from dnet.commands.progress import progress
        from dnet.datasets.reader import EpisodeReader
        from dnet.datasets.stores import as_place
        from dnet.recorders.film import film

        place = as_place(self.files[0])
        log = place / "run.mcap" if isinstance(place, Path) and place.is_dir() else place
        with EpisodeReader(log) as episode, progress(console, "pictures") as bar:
            task = bar.add_task("drawing", total=None)
            film(
                episode,
                out,
                on_picture=lambda done, total: bar.update(task, completed=done, total=total),
            )
        print(out)
