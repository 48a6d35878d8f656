"""`dnet inspect merge`: one dataset out of several."""

from dataclasses import dataclass
from pathlib import Path

import tyro


@dataclass(frozen=True)
class Merge:
    """Put the episodes of several directories into a new one.

    A file that two of them hold byte for byte is taken once. Different episodes with one id are
    refused: record with another --seed, and ids differ. The files are links, which take no room,
    where the disk allows it; the directories stay as they are.

    Example: dnet inspect merge data/monday data/tuesday --out data/both
    """

    directories: tyro.conf.Positional[tuple[Path, ...]]
    """Directories of episodes."""
    out: Path
    """The new directory."""
    skip_broken: tyro.conf.FlagCreatePairsOff[bool] = False
    """Leave out files that cannot be read, instead of refusing them."""
    copy: tyro.conf.FlagCreatePairsOff[bool] = False
    """Copy the files instead of linking them."""
    json: tyro.conf.FlagCreatePairsOff[bool] = False
    """Print one JSON object instead of lines."""

    def run(self) -> None:
        """Merge the directories and say what is in the new one.

        Raises:
            DnetError: If a directory has no episodes, two of them clash, or the new one will not
                do.
        """
        from dataclasses import asdict
        from json import dumps

        from rich.console import Console

        from dnet.commands.index_bar import read_index
        from dnet.errors import TooFew
        from dnet.tools.merging import merge_datasets

        if not self.directories:
            raise TooFew("number of directories to merge", 0, 1)
        console = Console(stderr=True)
        merged = merge_datasets(
            [read_index(directory, console) for directory in self.directories],
            self.out,
            skip_broken=self.skip_broken,
            copy=self.copy,
        )
        # Whoever uses the new directory next finds it indexed.
        read_index(self.out, console)
        if self.json:
            print(dumps(asdict(merged), indent=2))
            return
        for path in merged.repeated:
            print(f"taken once: {path} is there already")
        for path in merged.broken:
            print(f"left out: {path} cannot be read")
        print(f"{merged.episodes} episodes in {self.out}")
