"""`dnet inspect import`: other people's clouds as episodes."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

if TYPE_CHECKING:
    from dnet.tools.import_npz import Imported


@dataclass(frozen=True)
class Import:
    """Make an episode of each .npz, those of `dnet inspect export --to npz` or your own.

    A file must hold `clouds`, an array (frames, points, 3), or `cloud_000`, `cloud_001` and so on,
    (points, 3) each; and `grasps` (frames, 3), the point that is moved: float32 or float64, in
    metres. It may hold `times` (frames,), seconds; `kinds` (frames,), each rest, shape or way;
    `joints` (frames, 2, 6); `nodes`, as the clouds; `meta`, a text of JSON. Without them times are
    0, 1, 2 and so on, the first frame is at rest and the others are settled shapes, joints are
    zeros and there are no nodes. What was converted, assumed or ignored is printed, and stands in
    the settings of the episode. Nothing is unpickled.

    In Python: numpy.savez("mine.npz", clouds=clouds, grasps=grasps)

    Example: dnet inspect import mine.npz --out data/mine
    """

    files: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="FILE.npz")]
    """The arrays, a file an episode; NAME.npz becomes NAME.mcap."""
    out: Path
    """The folder of the episodes; it may hold others."""
    json: tyro.conf.FlagCreatePairsOff[bool] = False
    """Print one JSON object instead of lines."""

    def run(self) -> None:
        """Import with a progress bar, and print what became of each file.

        Raises:
            TooFew: If there are no files.
            MissingPath: If one does not exist.
            BadArrays: If one does not hold what an episode is made of.
            OccupiedOutput: If there is an episode of its name already.
            Unwritten: If nothing can be written there.
        """
        from dataclasses import asdict
        from json import dumps

        from dnet.errors import TooFew

        if not self.files:
            raise TooFew("number of files", 0, 1)
        made = self._import()
        if self.json:
            print(dumps({"episodes": [asdict(one) for one in made]}, indent=2, default=str))
            return
        for one in made:
            print(f"{one.episode}: {one.frames} frames of {one.file}")
            for note in one.notes:
                print(f"  {note}")

    def _import(self) -> "list[Imported]":
        from rich.console import Console

        from dnet.commands.progress import progress
        from dnet.tools.import_npz import import_files

        console = Console(stderr=True)
        bars = progress(console, "files")
        bars.live.transient = True
        bars.disable = not console.is_terminal
        with bars:
            task = bars.add_task("importing", total=None)
            return import_files(
                self.files,
                self.out,
                on_file=lambda done, total: bars.update(task, completed=done, total=total),
            )
