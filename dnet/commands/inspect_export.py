"""`dnet inspect export`: a dataset in the formats of others."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

if TYPE_CHECKING:
    from collections.abc import Callable

    from rich.console import Console

    from dnet.datasets.index import Index
    from dnet.tools.exported_output import Exported


@dataclass(frozen=True)
class Export:
    """Write a dataset in a format that other tools read.

    - npz: a folder with a NAME.npz of each episode, for numpy alone; dnet inspect import reads it.
    - parquet: one table, a row a frame, for polars, pandas, DuckDB and others.
    - hdf5: one file, a group an episode, each array contiguous; needs deformernet[exchange].
    - lerobot: a folder that LeRobotDataset opens, format v3.0; actions are motions of the grasp.

    All carry, bit by bit: cloud, manipulation point, joints of both arms, mesh nodes, kind and time
    of each frame, and the metadata of each episode as JSON. Camera images, the places of the arms'
    links, and the goals and steps of servo runs stay in the logs alone.

    Files that cannot be read are left out and named. The output has its name when it is whole:
    after Ctrl-C nothing of it is there.

    Example: dnet inspect export data/box --to lerobot --out data/box-lerobot
    """

    directory: Annotated[tyro.conf.Positional[str | Path], tyro.conf.arg(metavar="DIRECTORY|URL")]
    """Where `dnet record` wrote."""
    to: Literal["npz", "parquet", "hdf5", "lerobot"]
    """The format."""
    out: Path
    """The new folder, of npz and lerobot, or file, of parquet and hdf5."""
    per_episode: tyro.conf.FlagCreatePairsOff[bool] = False
    """Of parquet: a folder with a NAME.parquet of each episode."""
    json: tyro.conf.FlagCreatePairsOff[bool] = False
    """Print one JSON object instead of a line."""

    def run(self) -> None:
        """Export with a progress bar, and print what was written.

        Raises:
            UnusedOption: If another format than Parquet is to be one file an episode.
            MissingPath: If there is no such directory.
            MissingExtra: If the format needs a package that is not installed.
            NoEpisodes: If no episode has a frame that can be read.
            BadEpisode: If clouds of one table would differ in their number of points, or two files
                hold the same episode.
            OccupiedOutput: If the output is already there.
            Unwritten: If it cannot be written.
        """
        from json import dumps

        from rich.console import Console

        from dnet.commands.index_bar import read_index
        from dnet.errors import UnusedOption
        from dnet.tools.exported_episode import left_out

        if self.per_episode and self.to != "parquet":
            raise UnusedOption("--per-episode", "--to parquet")
        console = Console(stderr=True)
        index = read_index(self.directory, console)
        done = self._export(index, console)
        missing = left_out(index)
        if self.json:
            counts = {"episodes": done.episodes, "frames": done.frames, "bytes": done.bytes}
            told = {"out": str(done.out), "format": self.to, **counts, "left_out": missing}
            print(dumps(told, indent=2))
            return
        for name, why in missing.items():
            print(f"left out {name}: {why}")
        print(
            f"{done.episodes} episodes, {done.frames} frames, {done.bytes / 1e6:.1f} MB "
            f"as {self.to} in {done.out}"
        )

    def _export(self, index: "Index", console: "Console") -> "Exported":
        from functools import partial

        from dnet.commands.progress import progress
        from dnet.tools.export_hdf5 import export_hdf5
        from dnet.tools.export_lerobot import export_lerobot
        from dnet.tools.export_npz import export_npz
        from dnet.tools.export_parquet import export_parquet

        exports: dict[str, Callable[..., Exported]] = {
            "npz": export_npz,
            "parquet": partial(export_parquet, per_episode=self.per_episode),
            "hdf5": export_hdf5,
            "lerobot": export_lerobot,
        }
        bars = progress(console, "episodes")
        bars.live.transient = True
        bars.disable = not console.is_terminal
        with bars:
            task = bars.add_task("exporting", total=None)
            return exports[self.to](
                index,
                self.out,
                on_episode=lambda done, total: bars.update(task, completed=done, total=total),
            )
