"""`dnet inspect split`: a dataset parted into what to learn from and what to judge by."""

from dataclasses import dataclass
from pathlib import Path

import tyro


@dataclass(frozen=True)
class Split:
    """Part a dataset into the folders training and validation, as a training would.

    The sides are those of `dnet train` with the same --validation and --seed, and go by the ids of
    the episodes. One without two settled frames, of which nothing can be learned, lies in training;
    files that cannot be read are left out. The files are links, which take no room, where the disk
    allows it.

    Example: dnet inspect split data/box --out data/box-split
    """

    directory: tyro.conf.Positional[Path]
    """A directory of episodes; it stays as it is."""
    out: Path
    """Gets the folders training and validation."""
    validation: float = 0.15
    """Share of the episodes to judge by; both sides get at least one."""
    seed: int = 0
    """Of the division."""
    copy: tyro.conf.FlagCreatePairsOff[bool] = False
    """Copy the files instead of linking them."""
    json: tyro.conf.FlagCreatePairsOff[bool] = False
    """Print one JSON object instead of lines."""

    def run(self) -> None:
        """Part the dataset and say what is where.

        Raises:
            DnetError: If there are too few episodes, or the output directory will not do.
        """
        from dataclasses import asdict
        from json import dumps

        from rich.console import Console

        from dnet.commands.index_bar import read_index
        from dnet.tools.splitting import split_dataset

        index = read_index(self.directory, Console(stderr=True))
        sides = split_dataset(
            index, self.out, fraction=self.validation, seed=self.seed, copy=self.copy
        )
        if self.json:
            print(dumps([asdict(side) for side in sides], indent=2, default=str))
            return
        for name, why in index.broken().select("name", "note").iter_rows():
            print(f"left out: {index.path(name)} {why}")
        for side in sides:
            print(f"{side.folder}: {side.episodes} episodes, {side.shapes} shapes")
