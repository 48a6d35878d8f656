"""The progress bar of long work: what is done, how fast, how long it still takes."""

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text


class SpeedColumn(ProgressColumn):
    """How many things are done in a second."""

    def __init__(self, things: str) -> None:
        super().__init__()
        self._things = things

    def render(self, task: Task) -> Text:
        """Return the speed of a task, blank before it is known."""
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:.2f} {self._things}/s")


def progress(console: Console, things: str) -> Progress:
    """Return a progress bar that counts `things`."""
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        SpeedColumn(things),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        console=console,
    )
