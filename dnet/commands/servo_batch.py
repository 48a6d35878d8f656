"""A batch of servo runs on the screen: a progress bar, and a table at the end."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dnet.evaluation.servo_scores import Score
    from dnet.trials.request import Trial


def run_batch(trials: "Sequence[Trial]", *, jobs: int, out: Path) -> None:
    """Carry out the trials that are not finished, and print what all of them came to.

    Raises:
        DnetError: If there are no processes to run them on, or one of them dies.
    """
    from rich.console import Console
    from rich.table import Table

    scores = finish(trials, jobs=jobs, what="servoing")
    table = Table("run", "outcome", "motions", "Chamfer (mm)", "floor", "nodes (mm)")
    for trial, score in zip(trials, scores, strict=True):
        table.add_row(
            trial.out.name,
            score.outcome,
            str(score.motions),
            f"{1e3 * score.first:.2f} -> {1e3 * score.last:.2f}",
            f"{1e3 * score.floor:.2f}",
            f"{1e3 * score.nodes_last:.2f}",
        )
    console = Console()
    console.print(table)
    console.print(f"{len(trials)} runs in {out}; `dnet play {out}/RUN` shows one", highlight=False)


def finish(trials: "Sequence[Trial]", *, jobs: int, what: str) -> "list[Score]":
    """Carry out what is not finished, with a progress bar; return what every trial came to.

    Ctrl-C ends the runs under way; the next call begins those again.

    Raises:
        DnetError: If there are no processes to run them on, or one of them dies.
        KeyboardInterrupt: After Ctrl-C.
    """
    import threading

    from rich.console import Console

    from dnet.commands.progress import progress
    from dnet.commands.stopping import stopping
    from dnet.errors import TooFew
    from dnet.evaluation.servo_scores import read_score
    from dnet.trials.batch import missing, run_trials

    if jobs < 1:
        raise TooFew("--jobs", jobs, 1)
    console = Console(stderr=True)
    todo = missing(trials)
    asked = threading.Event()
    with stopping(asked.set), progress(console, "runs") as bar:
        task = bar.add_task(what, total=len(trials), completed=len(trials) - len(todo))
        for report in run_trials(todo, jobs=min(jobs, max(len(todo), 1)), stop=asked.is_set):
            bar.advance(task)
            line = f"{report.trial.out.name}: {report.outcome}, {report.line}"
            bar.console.print(line, highlight=False, markup=False, soft_wrap=True)
    if asked.is_set():
        raise KeyboardInterrupt
    return [read_score(trial.out) for trial in trials]
