"""`dnet inspect repair`: what a crash left, saved."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

if TYPE_CHECKING:
    from dnet.tools.repair import Repaired


@dataclass(frozen=True)
class Repair:
    """Save the whole frames of killed, cut-off and damaged episodes as new files.

    Reads each .mcap.part, and each .mcap that is not whole, from its front up to where it is cut
    or damaged, and writes what it found into a new .mcap with an index. The new file counts as
    unfinished, and its metadata dnet.repair says why; only one that had lost nothing but its index
    is finished as before. The originals stay as they are, also one that is still being recorded,
    and the new files lie in a folder of their own: no episode counts twice. To go on with a killed
    recording, repeat its `dnet record`; it needs no repair.

    `lost` is a dash where nothing says how many frames there were. Exits with 1 if nothing could
    be saved of some file.

    Example: dnet inspect repair data/box
    """

    path: tyro.conf.Positional[Path]
    """A directory of episodes, or one file."""
    out: Path | None = None
    """Where the new files go; by default into the folder repaired beside the originals."""
    json: tyro.conf.FlagCreatePairsOff[bool] = False
    """Print one JSON object instead of a table."""

    def run(self) -> None:
        """Repair with a progress bar, and print one row a file.

        Raises:
            MissingPath: If there is no such directory or file.
            NoEpisodes: If a directory holds neither an episode nor an unfinished one.
            SharedFolder: If the new files would lie among the originals.
            OccupiedOutput: If a new file would replace another.
            Unwritten: If nothing can be written there.
            NothingSaved: If some file holds no whole frame.
        """
        from collections import Counter
        from dataclasses import asdict
        from json import dumps

        from dnet.tools.repair import refuse_unsaved, repair_table
        from dnet.tools.tables import print_table

        found = self._repair()
        if self.json:
            print(dumps({"files": [asdict(one) for one in found]}, indent=2, default=str))
        else:
            print_table(repair_table(found))
            counts = Counter(one.outcome for one in found)
            folders = {str(one.saved.parent) for one in found if one.saved is not None}
            told = [f"{count} {outcome}" for outcome, count in counts.items()]
            print(", ".join(told) + "".join(f"; saved into {folder}" for folder in folders))
        refuse_unsaved(found)

    def _repair(self) -> "list[Repaired]":
        from rich.console import Console

        from dnet.commands.progress import progress
        from dnet.tools.repair import repair, repair_directory

        if not self.path.is_dir():
            return [repair(self.path, self.out)]
        console = Console(stderr=True)
        bars = progress(console, "files")
        bars.live.transient = True
        bars.disable = not console.is_terminal
        with bars:
            task = bars.add_task("repairing", total=None)
            return repair_directory(
                self.path,
                self.out,
                on_file=lambda done, total: bars.update(task, completed=done, total=total),
            )
