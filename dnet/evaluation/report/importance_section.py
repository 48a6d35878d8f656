"""What a bad manipulation point costs: figure 2 of the paper."""

from pathlib import Path

import numpy as np

from dnet.datasets.reader import EpisodeReader
from dnet.evaluation.report.asked import Asked
from dnet.evaluation.report.runs import Run, links, read_runs
from dnet.evaluation.report.scene_stills import draw_importance
from dnet.evaluation.report.snapshot import Snapshot, snapshot
from dnet.evaluation.report.values import Cell, Claim, Column, Section, Sheet, Still
from dnet.evaluation.servo_scores import RUN, Score
from dnet.types import Cloud, Point

_COLUMNS = (
    Column("point"),
    Column("outcome"),
    Column("motions", 0),
    Column("Chamfer, start, mm", 2),
    Column("Chamfer, end, mm", 2),
    Column("floor, mm", 2),
    Column("nodes off, mm", 2),
    Column("legacy norm, end", 3),
)


def importance_section(folder: Path, asked: Asked | None, *, title: str, out: Path) -> Section:
    """Return how the two runs ended.

    Args:
        folder: Of the experiment.
        asked: What was asked of it; None if it was not run.
        title: Of the section.
        out: Directory of the report.

    Raises:
        DnetError: If a log cannot be read.
    """
    about = (
        "One goal, driven to by DeformerNet from the point at which it was made, and from the "
        "reachable point that is farthest from it.",
    )
    if asked is None:
        return Section("importance", title, about, claims=(_claim(None, None, "not run"),))
    runs = read_runs(folder, asked)
    rows = tuple(_row(name, run) for name, some in runs.items() for run in some)
    scores = {name: some[0].score if some else None for name, some in runs.items()}
    return Section(
        "importance",
        title,
        about,
        claims=(_claim(scores.get("good"), scores.get("bad"), "not carried out"),),
        sheets=(Sheet("importance", "How the runs ended", _COLUMNS, rows),),
        stills=_stills([(name, run) for name, some in runs.items() for run in some]),
        runs=links(runs, out),
    )


def _row(name: str, run: Run) -> tuple[Cell, ...]:
    if run.score is None:
        return (name, "not run", *[None] * 6)
    score = run.score
    distances = (score.first, score.last, score.floor, score.nodes_last)
    mm = (1e3 * one for one in distances)
    return (name, score.outcome, score.motions, *mm, score.legacy_last)


def _claim(good: Score | None, bad: Score | None, why_not: str) -> Claim:
    what = "a good manipulation point reaches the goal, a bad one cannot"
    if good is None or bad is None:
        return Claim("figure 2", what, "shown", "", None, why_not)
    ours = f"{1e3 * good.last:.2f} mm from the good point, {1e3 * bad.last:.2f} mm from the bad one"
    # A run that could not end anywhere has not reached the goal.
    failed = not np.isfinite(bad.last) or bad.last > 2 * good.last
    reason = (
        "met if the good point makes most of the possible way or ends near the floor, and the bad "
        "one ends twice as far off"
    )
    return Claim("figure 2", what, "shown", ours, bool((good.near or good.most) and failed), reason)


def _stills(runs: list[tuple[str, Run]]) -> tuple[Still, ...]:
    ends: list[tuple[str, Snapshot, Snapshot, Point]] = []
    goal: Cloud | None = None
    for name, run in runs:
        if run.score is None or not (run.folder / RUN).is_file():
            continue
        with EpisodeReader(run.folder / RUN) as log:
            aim = log.goal()
            if aim is None or not len(log):
                continue
            goal = aim.copy()
            point = np.array(log.meta.scene.manipulation_point, dtype=np.float64)
            ends.append((name, snapshot(log, 0), snapshot(log, len(log) - 1), point))
    if goal is None:
        return ()
    caption = (
        "Figure 2: the goal, the good manipulation point (red) and what came of it, the bad one "
        "(purple) and what came of it; the goal as sparse red points."
    )
    return (Still("importance", caption, draw_importance(goal, ends)),)
