"""What `dnet train` shows: the data, a progress bar with the errors, a closing table."""

from collections.abc import Mapping
from types import TracebackType

from rich.console import Console
from rich.progress import (
    BarColumn,
    Progress,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.table import Table

from dnet.training.division import Division, pairs_of
from dnet.training.frames import Frames, Target
from dnet.training.progress import EpochDone, StepDone
from dnet.training.scores import Errors, Scores, no_motion


def show_data(
    console: Console, division: Division, training: Frames, *, target: Target = "motion"
) -> None:
    """Print what there is to learn from, and how wrong it is to always predict the same."""
    table = division.training
    seen, unseen = (len(part.episodes_seen) for part in (table, division.unseen_episodes))
    frames = f"{seen} episodes to train on, {unseen} to validate on; {len(table)} frames, "
    if target == "point":
        points = table.grasps[table.rest]
        spread = 1e6 * float(points.var(axis=0).mean()) if len(points) else 0.0
        console.print(
            f"{frames}{len(points)} manipulation points (predicting their mean: {spread:.0f} mm²)"
        )
    else:
        zero = no_motion(training)
        console.print(
            f"{frames}{pairs_of(table)} ordered pairs, mean |motion| {zero.zero_mean_mm:.1f} mm "
            f"(predicting no motion: {zero.zero_mse_mm2:.0f} mm², their mean: "
            f"{zero.mean_mse_mm2:.0f} mm²)"
        )
    if division.skipped:
        console.print(f"{division.skipped} files without two settled frames left out")


class TrainingBar:
    """A progress bar that tells the epoch and the latest errors, for use in a `with`."""

    def __init__(self, console: Console, *, epochs: int | float) -> None:
        self._epochs = epochs
        self._progress = Progress(
            TextColumn("epoch {task.fields[epoch]}"),
            BarColumn(),
            TaskProgressColumn(),
            TextColumn("loss {task.fields[loss]}"),
            TextColumn("unseen episodes {task.fields[validation]}"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
            console=console,
        )
        self._task = self._progress.add_task("", total=1.0, epoch="", loss="", validation="")

    def __enter__(self) -> "TrainingBar":
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._progress.stop()

    def show(self, event: StepDone | EpochDone) -> None:
        """Move on to `event`."""
        bar, task = self._progress, self._task
        bar.update(task, completed=event.progress, epoch=f"{event.epoch}/{self._epochs:g}")
        if isinstance(event, EpochDone):
            validation = f"{event.unseen_episodes.main.mse_mm2:.1f} mm²"
            bar.update(task, loss=f"{event.loss:.3g}", validation=validation)


def error_table(
    errors: Mapping[str, Errors | None],
    *,
    title: str = "errors of the best network",
    zero: str = "no motion",
) -> Table:
    """Return the errors on each set of frames as a table.

    Args:
        errors: By what they are on.
        title: Of the table.
        zero: What predicting zero stands for.
    """
    table = Table(title=title)
    names = ("frames of", "pairs", "count", "MSE", "sum", "error", "R²", zero)
    for name in names:
        table.add_column(name, justify="left" if name in ("frames of", "pairs") else "right")
    for name, of in errors.items():
        if of is None:
            continue
        if of.any_pair is not None:
            table.add_row(name, "any two", *_cells(of.any_pair))
        if of.from_rest is not None:
            table.add_row(name, "rest to shape", *_cells(of.from_rest))
    table.caption = (
        "MSE: squared error, mean over x, y, z, mm²; sum: summed over them; error: mean "
        f"Euclidean distance, mm; {zero}: MSE of predicting that"
    )
    return table


def _cells(scores: Scores) -> tuple[str, ...]:
    return (
        str(scores.pairs),
        f"{scores.mse_mm2:.2f}",
        f"{scores.sum_mm2:.2f}",
        f"{scores.mean_mm:.2f}",
        "-" if scores.r2 is None else f"{scores.r2:.3f}",
        f"{scores.zero_mse_mm2:.1f}",
    )
