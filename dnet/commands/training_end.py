"""What `dnet train` leaves at its end: the errors of the best network, told and written down."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console

    from dnet.training.division import Division
    from dnet.training.frames import Frames
    from dnet.training.run import RunWriter
    from dnet.training.training import Training

JUDGED = 5000
"""Frames of the training set that the best network is judged by at the end."""


def finish(
    training: "Training",
    division: "Division",
    *,
    run: "RunWriter",
    frames: "Frames",
    console: "Console",
    out: "Console",
) -> None:
    """Judge the best network on everything that was held out, print and write the errors.

    Args:
        training: As it ended.
        division: The data.
        run: Of the training.
        frames: What was learned from.
        console: For what is told along the way.
        out: For the result.
    """
    from dnet.commands.progress import progress
    from dnet.commands.training_screen import error_table
    from dnet.training.checkpoints import load_any
    from dnet.training.division import thinned
    from dnet.training.frames import Frames
    from dnet.training.model_card import write_card
    from dnet.training.scores import Errors
    from dnet.training.tasks import task_of

    if training.stopped and training.progress < 1:
        console.print(_stopped_line(training, run))
        return
    network = load_any(run.path).to(next(training.model.parameters()).device)
    task = task_of(network)
    parts = division.parts | {"training": thinned(division.training, JUDGED)}
    errors: dict[str, Errors | None] = {}
    with progress(console, "clouds") as bar:
        bar_task = bar.add_task("judging", total=sum(len(table) for table in parts.values()))
        for name, table in parts.items():
            judged = Frames.of(table, frames.config, samplings=frames.tables.samplings)
            errors[name] = task.judge(
                network, judged, on_clouds=lambda done: bar.advance(bar_task, done)
            )
    run.add_errors(errors)
    write_card(run, errors, task)
    out.print(error_table(errors, zero=task.zero))
    console.print(_closing_line(training, run))


def _closing_line(training: "Training", run: "RunWriter") -> str:
    waited = 100 * training.waited / max(training.seconds, 1e-9)
    return (
        f"{len(run.history)} epochs in {training.seconds:.0f} s, {waited:.1f} % of it waiting for "
        f"clouds; {_best_line(run)}wrote {run.path}"
    )


def _stopped_line(training: "Training", run: "RunWriter") -> str:
    return (
        f"interrupted after {training.steps} batches, {training.seconds:.0f} s; {_best_line(run)}"
        f"--resume goes on with {run.path}"
    )


def _best_line(run: "RunWriter") -> str:
    best = run.best
    if best is None:
        return ""
    return f"the best was epoch {best['epoch']}; "
