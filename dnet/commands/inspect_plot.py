"""`dnet inspect plot`: one picture to judge a dataset by."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

if TYPE_CHECKING:
    from rich.console import Console

    from dnet.datasets.index import Index


@dataclass(frozen=True)
class Plot:
    """Draw one picture of a dataset: its shapes, how far they moved, where they were held.

    Above, shapes spread evenly over the dataset, all at one scale: coloured by height, the rest
    shape in grey behind, the motion of the grasp as an arrow. Each is titled EPISODE:FRAME and how
    far the grasp has moved; `dnet play DIRECTORY --episode EPISODE` shows more of it. Look for
    clouds that are torn, folded or nearly empty.

    Below, how far the grasp moved and how far the shape changed: a peak at zero is data that
    teaches little. Then where the grasp was, from above and from the side: a network knows
    nothing of white gaps.

    Example: dnet inspect plot data/box --out box.png --sheets 24
    """

    directory: Annotated[tyro.conf.Positional[str | Path], tyro.conf.arg(metavar="DIRECTORY|URL")]
    """Where `dnet record` wrote."""
    out: Path
    """The picture: a .png, .pdf or .svg; an older one is replaced."""
    episode: Annotated[tuple[str, ...], tyro.conf.arg(metavar="ID")] = ()
    """Draw these episodes alone: ids, or numbers of pairs."""
    sheets: int = 12
    """How many shapes to draw."""

    def run(self) -> None:
        """Draw, with a progress bar, and print where the picture is.

        Raises:
            UnknownPicture: If the picture's ending is not a known one.
            TooFew: If `sheets` is below one, or there is no shape to draw.
            DnetError: If there is no such directory or episode, or it cannot be read.
        """
        from rich.console import Console

        from dnet.commands.progress import progress
        from dnet.tools.plotting import plot_dataset
        from dnet.tools.statistics_figure import check_picture

        check_picture(self.out)
        console = Console(stderr=True)
        index = self._index(console)
        bars = progress(console, "shapes")
        bars.live.transient = True
        bars.disable = not console.is_terminal
        with bars:
            task = bars.add_task("measuring", total=None)
            plot_dataset(
                index,
                self.out,
                sheets=self.sheets,
                on_shape=lambda done, total: bars.update(task, completed=done, total=total),
            )
        print(self.out)

    def _index(self, console: "Console") -> "Index":
        from dnet.commands.index_bar import read_index
        from dnet.tools.picking import pick_episodes

        index = read_index(self.directory, console)
        return pick_episodes(index, self.episode) if self.episode else index
