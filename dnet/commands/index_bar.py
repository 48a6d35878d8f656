"""The index of a dataset, brought up to date under a progress bar."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

    from dnet.datasets.index import Index
    from dnet.types import Place


@contextmanager
def reading(console: "Console") -> "Iterator[Callable[[int, int], None]]":
    """Show how many files are read; yield what to call with their number and that of all."""
    from dnet.commands.progress import progress

    bars = progress(console, "episodes")
    # Reading is no result: none of it stays on the screen, or goes into a log.
    bars.live.transient = True
    bars.disable = not console.is_terminal
    with bars:
        task = bars.add_task("reading", total=None)
        yield lambda done, total: bars.update(task, completed=done, total=total)


def read_index(root: "Place", console: "Console") -> "Index":
    """Return the index of the episodes in a folder or under a URL.

    Raises:
        DnetError: If there is no episode, or a store does not answer.
    """
    from dnet.datasets.index import open_index

    with reading(console) as on_file:
        return open_index(root, on_file=on_file)
