"""`dnet inspect`: what was recorded, as tables."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import tyro


@dataclass(frozen=True)
class List:
    """List the episodes of a directory: frames, shapes, simulated seconds, size.

    Unfinished and broken files are listed with a note.

    Example: dnet inspect ls data/box
    """

    directory: tyro.conf.Positional[Path]
    """Where `dnet record` wrote."""

    def run(self) -> None:
        """Print one row an episode and a line of sums."""
        import polars as pl
        from rich.console import Console

        from dnet.commands.tables import print_table
        from dnet.tools.listing import list_episodes

        episodes = list_episodes(self.directory)
        console = Console()
        noted = episodes["note"].is_in([""]).all()
        print_table(console, episodes.drop("note") if noted else episodes)
        finished = episodes.filter(pl.col("finished"))
        console.print(
            f"{finished.height} finished episodes of {episodes.height}, "
            f"{episodes['shapes'].sum()} shapes, {episodes['MB'].sum():.1f} MB"
        )


@dataclass(frozen=True)
class Info:
    """Describe one episode: how it was made, and each of its frames.

    `motion_mm` is how far the grasp is from where it was at rest, `chamfer_mm` how far the
    shape is from the rest shape.

    Example: dnet inspect info data/box/episode-00000.mcap
    """

    file: tyro.conf.Positional[Path]
    """An `.mcap` of `dnet record` or `dnet servo`."""

    def run(self) -> None:
        """Print the summary and the frames."""
        from rich.console import Console

        from dnet.commands.tables import print_table
        from dnet.tools.listing import describe_episode

        description = describe_episode(self.file)
        console = Console()
        for key, value in description.summary.items():
            console.print(f"{key:<28} {_text(value)}", markup=False, highlight=False)
        print_table(console, description.frames)


@dataclass(frozen=True)
class Inspect:
    """Look at what was recorded: a directory of episodes, or one of them.

    Example: dnet inspect ls data/box
    """

    what: tyro.conf.OmitSubcommandPrefixes[
        Annotated[List, tyro.conf.subcommand("ls")]
        | Annotated[Info, tyro.conf.subcommand("info")]
    ]

    def run(self) -> None:
        """Print the table that was asked for."""
        self.what.run()


def _text(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)
