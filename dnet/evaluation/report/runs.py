"""The servo runs of an experiment, by method, with what each came to."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dnet.datasets.reader import EpisodeReader
from dnet.evaluation.report.asked import Asked
from dnet.evaluation.report.values import RunLink
from dnet.evaluation.servo_scores import REFUSED, RUN, Score, read_score

RECORDING = "run.rrd"


@dataclass(frozen=True, slots=True)
class Run:
    """One run that was asked for."""

    method: str
    folder: Path
    score: Score | None
    """None if it has not been carried out, or not to its end."""


def read_runs(folder: Path, asked: Asked) -> dict[str, list[Run]]:
    """Return every run of the experiment in a directory, by method.

    Raises:
        DnetError: If a log cannot be read.
    """
    return {
        method: [_read(method, folder / name) for name in names]
        for method, names in asked.runs.items()
    }


def scores_of(runs: Sequence[Run]) -> list[Score]:
    """Return the scores of those that were carried out, however they ended."""
    return [run.score for run in runs if run.score is not None]


def within(scores: Sequence[Score], tolerance: float, *, legacy: bool = False) -> float:
    """Return the share of all runs that ended within a tolerance.

    A run that never began, or of whose end nothing was seen, was not.

    Args:
        scores: The runs; NaN is returned for none.
        tolerance: In metres of the symmetric mean Chamfer distance.
        legacy: Whether it is one of the legacy norm instead.
    """
    if not scores:
        return float("nan")
    last = np.array([one.legacy_last if legacy else one.last for one in scores])
    return float(np.mean(last <= tolerance))  # NaN is not


def links(runs: Mapping[str, Sequence[Run]], out: Path) -> tuple[RunLink, ...]:
    """Return where the files of all runs are, from the directory of the report."""
    return tuple(
        RunLink(
            f"{run.method}, {run.folder.name}",
            "not carried out" if run.score is None else run.score.outcome,
            files_in(run.folder, out),
        )
        for some in runs.values()
        for run in some
    )


def files_in(folder: Path, out: Path) -> tuple[Path, ...]:
    """Return what logs a directory of a run holds, from the directory of the report."""
    there = (folder / name for name in (RUN, RECORDING, REFUSED))
    return tuple(path.relative_to(out) for path in there if path.is_file())


def _read(method: str, folder: Path) -> Run:
    if (folder / RUN).is_file():
        with EpisodeReader(folder / RUN) as log:
            if (log.result or {"outcome": "interrupted"}).get("outcome") == "interrupted":
                return Run(method, folder, None)
        return Run(method, folder, read_score(folder))
    refused = (folder / REFUSED).is_file()
    return Run(method, folder, read_score(folder) if refused else None)
