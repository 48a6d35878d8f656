"""`dnet inspect`: what was recorded, as tables."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from dnet.commands.inspect_diff import Diff
from dnet.commands.inspect_export import Export
from dnet.commands.inspect_filter import Filter
from dnet.commands.inspect_import import Import
from dnet.commands.inspect_material import Material
from dnet.commands.inspect_merge import Merge
from dnet.commands.inspect_plot import Plot
from dnet.commands.inspect_repair import Repair
from dnet.commands.inspect_split import Split
from dnet.commands.inspect_stats import Stats
from dnet.commands.inspect_validate import Validate


@dataclass(frozen=True)
class List:
    """List the episodes of a directory: frames, shapes, simulated seconds, size.

    Unfinished and broken files are listed with a note. The first call indexes the directory; the
    next ones read new and changed files alone.

    Example: dnet inspect ls data/box
    """

    directory: Annotated[tyro.conf.Positional[str | Path], tyro.conf.arg(metavar="DIRECTORY|URL")]
    """Where `dnet record` wrote."""
    csv: tyro.conf.FlagCreatePairsOff[bool] = False
    """Print comma-separated values instead of a table."""
    json: tyro.conf.FlagCreatePairsOff[bool] = False
    """Print a JSON list of objects instead of a table."""

    def run(self) -> None:
        """Print one row an episode and, for people, a line of sums."""
        from rich.console import Console

        from dnet.commands.index_bar import reading
        from dnet.tools.listing import list_episodes
        from dnet.tools.tables import print_frame

        with reading(Console(stderr=True)) as on_file:
            episodes = list_episodes(self.directory, on_file=on_file)
        if self.csv or self.json:
            print_frame(episodes, "csv" if self.csv else "json")
            return
        quiet = (episodes["note"] == "").all()
        print_frame(episodes.drop("note") if quiet else episodes, "table")
        print(
            f"{episodes['finished'].sum()} of {episodes.height} episodes finished, "
            f"{episodes['shapes'].sum()} shapes, {episodes['MB'].sum():.1f} MB"
        )


@dataclass(frozen=True)
class Info:
    """Describe one episode: how it was made, and each of its frames.

    `motion_mm` is how far the grasp is from where it was at rest, `chamfer_mm` how far the
    shape is from the rest shape.

    Example: dnet inspect info data/box/episode-00000.mcap
    """

    file: Annotated[tyro.conf.Positional[str | Path], tyro.conf.arg(metavar="FILE|URL")]
    """An `.mcap` of `dnet record` or `dnet servo`."""
    json: tyro.conf.FlagCreatePairsOff[bool] = False
    """Print one JSON object instead: `summary` and `frames`."""

    def run(self) -> None:
        """Print the summary and the frames."""
        from json import dumps

        from dnet.tools.listing import describe_episode
        from dnet.tools.tables import print_table

        description = describe_episode(self.file)
        if self.json:
            frames = description.frames.to_dicts()
            print(dumps({"summary": description.summary, "frames": frames}, indent=2))
            return
        width = max(len(key) for key in description.summary)
        for key, value in description.summary.items():
            text = f"{value:.6g}" if isinstance(value, float) else str(value)
            print(f"{key:<{width}}  {text}")
        print_table(description.frames)


@dataclass(frozen=True)
class Inspect:
    """Look after what was recorded: list, describe, check, save, compare, part and merge it.

    Example: dnet inspect ls data/box
    """

    what: tyro.conf.OmitSubcommandPrefixes[
        Annotated[List, tyro.conf.subcommand("ls")]
        | Annotated[Info, tyro.conf.subcommand("info")]
        | Annotated[Stats, tyro.conf.subcommand("stats")]
        | Annotated[Plot, tyro.conf.subcommand("plot")]
        | Annotated[Validate, tyro.conf.subcommand("validate")]
        | Annotated[Repair, tyro.conf.subcommand("repair")]
        | Annotated[Merge, tyro.conf.subcommand("merge")]
        | Annotated[Split, tyro.conf.subcommand("split")]
        | Annotated[Filter, tyro.conf.subcommand("filter")]
        | Annotated[Diff, tyro.conf.subcommand("diff")]
        | Annotated[Export, tyro.conf.subcommand("export")]
        | Annotated[Import, tyro.conf.subcommand("import")]
        | Annotated[Material, tyro.conf.subcommand("material")]
    ]

    def run(self) -> None:
        """Print what was asked for."""
        self.what.run()
