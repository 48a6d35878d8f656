"""`dnet inspect stats`: the figures of a recording."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

if TYPE_CHECKING:
    from dnet.tools.statistics_recorded import Recorded


@dataclass(frozen=True)
class Stats:
    """Tell the figures of a recording: counts, sizes, displacements, rejected draws, speed.

    All are of finished episodes and computed from the episodes themselves, but the speed, which
    `dnet record` notes beside them in timings.jsonl.

    Example: dnet inspect stats data/box --plot box.png
    """

    directory: tyro.conf.Positional[Path]
    """Where `dnet record` wrote."""
    json: tyro.conf.FlagCreatePairsOff[bool] = False
    """Print one JSON object instead of tables."""
    plot: Path | None = None
    """Draw a picture as well: a .png, .pdf or .svg."""

    def run(self) -> None:
        """Read the episodes, with a progress bar, and print their figures.

        Raises:
            MissingPath: If there is no such directory.
            NoEpisodes: If it holds no finished episode.
            UnknownPicture: If the picture's ending is not a known one.
        """
        from dataclasses import asdict
        from json import dumps

        from dnet.tools.statistics import statistics
        from dnet.tools.statistics_report import print_statistics
        from dnet.tools.statistics_speed import read_speed

        if self.plot is not None:
            from dnet.tools.statistics_figure import check_picture

            check_picture(self.plot)
        index = self._read()
        figures = statistics(index, read_speed(self.directory))
        if self.plot is not None:
            from dnet.tools.statistics_figure import draw_statistics

            draw_statistics(index, figures, self.plot)
        if self.json:
            print(dumps(asdict(figures), indent=2, allow_nan=False))
        else:
            print_statistics(figures)

    def _read(self) -> "Recorded":
        from rich.console import Console

        from dnet.commands.index_bar import reading
        from dnet.tools.statistics_recorded import read_recorded

        with reading(Console(stderr=True)) as on_episode:
            return read_recorded(self.directory, on_episode=on_episode)
