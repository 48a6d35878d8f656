"""The runs of the servo cases, as their logs tell them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from dnet.datasets.reader import EpisodeReader
from dnet.evaluation.report.runs import Run
from dnet.evaluation.report.snapshot import Snapshot, snapshot
from dnet.evaluation.report.values import Values
from dnet.evaluation.servo_scores import RUN, Score
from dnet.geometry.chamfer import chamfer
from dnet.types import Cloud, Point

FRAMES = 5
"""Key frames of a sequence, the first and the last among them."""


@dataclass(frozen=True, slots=True)
class Story:
    """One run, as its log tells it."""

    score: Score
    times: Values
    """Seconds of simulation since the first look."""
    distances_mm: Values
    """Chamfer distance to the goal at each look."""
    goal: Cloud
    shots: tuple[Snapshot, ...]
    """Key frames."""
    shown: tuple[int, ...]
    """Which looks those are."""
    truth: Point
    chosen: Point


Stories = Mapping[str, Sequence[Story | None]]
"""Of each method, case by case; None where there is no log of one."""


def read_story(run: Run) -> Story | None:
    """Return what a run was like; None if it never began, or was not carried out."""
    if run.score is None or not (run.folder / RUN).is_file():
        return None
    with EpisodeReader(run.folder / RUN) as log:
        goal = log.goal()
        if goal is None or not len(log):
            return None
        distances = [1e3 * chamfer(log.cloud(index), goal) for index in range(len(log))]
        count = min(FRAMES, len(log))
        shown = tuple(np.linspace(0, len(log) - 1, count).round().astype(int).tolist())
        return Story(
            run.score,
            np.array(log.times - log.times[0]),
            np.array(distances),
            goal.copy(),
            tuple(snapshot(log, index) for index in shown),
            shown,
            np.array(log.meta.settings["true_point"], dtype=np.float64),
            np.array(log.meta.scene.manipulation_point, dtype=np.float64),
        )
