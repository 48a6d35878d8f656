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

from dnet.training.episodes import Division
from dnet.training.frames import Frames
from dnet.training.loop import EpochDone, StepDone
from dnet.training.scores import Errors, Scores, score


def show_data(console: Console, division: Division, training: Frames) -> None:
    """Print what there is to learn from, and how wrong it is to predict no motion."""
    zero = score_of_no_motion(training)
    console.print(
        f"{len(division.training)} episodes to train on, {len(division.validation)} to validate "
        f"on; {len(training.grasps)} frames, {training.pairs} ordered pairs, "
        f"mean |motion| {zero.zero_mean_mm:.1f} mm "
        f"(predicting no motion: {zero.zero_mse_mm2:.0f} mm²)"
    )
    if division.skipped:
        console.print(f"{division.skipped} files without two settled frames left out")


class TrainingBar:
    """A progress bar that tells the epoch and the latest errors, for use in a `with`."""

    def __init__(self, console: Console, *, epochs: int) -> None:
        self._epochs = epochs
        self._progress = Progress(
            TextColumn("epoch {task.fields[epoch]}"),
            BarColumn(),
            TaskProgressColumn(),
            TextColumn("loss {task.fields[loss]}"),
            TextColumn("validation {task.fields[validation]}"),
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
        bar.update(task, completed=event.progress, epoch=f"{event.epoch}/{self._epochs}")
        if isinstance(event, EpochDone):
            validation = f"{event.validation.any_pair.mse_mm2:.1f} mm²"
            bar.update(task, loss=f"{event.loss_mm2:.1f}", validation=validation)


def error_table(errors: Mapping[str, Errors]) -> Table:
    """Return the errors on each set of frames as a table."""
    table = Table(title="errors of the best network")
    for name in ("frames of", "pairs", "count", "MSE", "error", "R²", "no motion"):
        table.add_column(name, justify="left" if name in ("frames of", "pairs") else "right")
    for name, of in errors.items():
        table.add_row(name, "any two", *_cells(of.any_pair))
        if of.from_rest is not None:
            table.add_row(name, "rest to shape", *_cells(of.from_rest))
    table.caption = (
        "MSE: mean over x, y, z, mm²; error: mean Euclidean distance, mm; "
        "no motion: MSE of predicting none"
    )
    return table


def score_of_no_motion(frames: Frames) -> Scores:
    """Return the scores of predicting zero for every pair of `frames`."""
    motions = frames.motions(*frames.all_pairs())
    return score(motions * 0, motions)


def _cells(scores: Scores) -> tuple[str, ...]:
    return (
        str(scores.pairs),
        f"{scores.mse_mm2:.2f}",
        f"{scores.mean_mm:.2f}",
        "-" if scores.r2 is None else f"{scores.r2:.3f}",
        f"{scores.zero_mse_mm2:.1f}",
    )
