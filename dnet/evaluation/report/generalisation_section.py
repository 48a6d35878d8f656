"""How DeformerNet does on what it did not learn from."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dnet.evaluation.report.asked import Asked
from dnet.evaluation.report.conditions import CONDITIONS, Condition
from dnet.evaluation.report.goals_section import success_plot
from dnet.evaluation.report.runs import links, read_runs, scores_of, within
from dnet.evaluation.report.values import Bar, BarPlot, Cell, Column, Section, Sheet
from dnet.evaluation.servo_scores import MOST, NEAR, Score
from dnet.evaluation.servo_table import summary

TOLERANCE_MM = 3.0
_COLUMNS = (
    Column("condition"),
    Column("what differs"),
    Column("distribution"),
    Column("runs", 0),
    Column("not run", 0),
    Column("outcomes"),
    Column("Chamfer, start, mm", 2),
    Column("Chamfer, end, mm", 2),
    Column("floor, mm", 2),
    Column("legacy norm, end", 3),
    Column("nodes off, mm", 2),
    Column(f"within {TOLERANCE_MM:g} mm, %", 0),
    Column(f"within {NEAR:g} x floor, %", 0),
    Column(f"{MOST:.0%} of the possible, %", 0),
)


def generalisation_section(folder: Path, asked: Asked | None, *, title: str, out: Path) -> Section:
    """Return what the runs under each condition came to.

    Args:
        folder: Of the experiment.
        asked: What was asked of it; None if it was not run.
        title: Of the section.
        out: Directory of the report.

    Raises:
        DnetError: If a log cannot be read.
    """
    about = (
        "Goals of episodes that were recorded under each condition, driven to by DeformerNet from "
        "the true manipulation point; in the quasi-static world but for stiffness: nothing weighs "
        "anything here, so that the shape at rest does not depend on it, only the way there.",
        "In distribution is what the network that ships learned from: boxes of 10 x 10 x 4 cm and "
        "1 kPa, a perfect camera, clouds of 2048 points; all else is out of it. Camera noise is in "
        "the goal, too. These conditions are of the follow-ups; the paper has one object.",
    )
    if asked is None:
        return Section("generalisation", title, about)
    runs = read_runs(folder, asked)
    scores = {name: scores_of(some) for name, some in runs.items()}
    missing = dict(asked.options.get("missing", {}))
    rows = []
    for condition in CONDITIONS:
        if condition.name in runs:
            some = scores[condition.name]
            rows.append(_row(condition, some, len(runs[condition.name]) - len(some)))
        elif condition.name in missing:
            head = (condition.name, condition.about, condition.distribution, 0, None)
            rows.append((*head, missing[condition.name], *[None] * (len(_COLUMNS) - 6)))
    note = f"Medians. Out of so many goals each: {asked.count} of {asked.full}."
    sheet = Sheet("generalisation", "Servo runs by condition", _COLUMNS, tuple(rows), note)
    return Section(
        "generalisation",
        title,
        about,
        sheets=(sheet,),
        plots=(
            BarPlot(
                "generalisation-ends",
                "Chamfer distance at the end: median and quartiles",
                "Chamfer distance at the end, mm",
                tuple(_bar(one, scores[one.name]) for one in CONDITIONS if scores.get(one.name)),
            ),
            success_plot("generalisation-success", scores, legacy=False),
        ),
        runs=links(runs, out),
    )


def _row(condition: Condition, scores: Sequence[Score], left: int) -> tuple[Cell, ...]:
    head = (condition.name, condition.about, condition.distribution, len(scores), left)
    if not scores:
        return (*head, "", *[None] * (len(_COLUMNS) - 6))
    figures = summary(scores)
    outcomes = Counter(score.outcome for score in scores).most_common()
    names = ("first_mm", "last_mm", "floor_mm", "legacy_last", "nodes_last_mm")
    medians = [value if isinstance(value := figures[name], float) else None for name in names]
    shares = (
        within(scores, TOLERANCE_MM / 1e3),
        float(np.mean([score.near for score in scores])),
        float(np.mean([score.most for score in scores])),
    )
    return (
        *head,
        ", ".join(f"{count} {outcome}" for outcome, count in outcomes),
        *medians,
        *(100 * share for share in shares),
    )


def _bar(condition: Condition, scores: Sequence[Score]) -> Bar:
    last = np.array([1e3 * score.last for score in scores if np.isfinite(score.last)])
    low, middle, high = np.quantile(last, (0.25, 0.5, 0.75)) if len(last) else [float("nan")] * 3
    return Bar(condition.name, float(middle), float(low), float(high), condition.distribution)
