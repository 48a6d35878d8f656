"""A hundred unseen goals: who reaches how many of them, within which tolerance."""

from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from dnet.evaluation.report.asked import Asked
from dnet.evaluation.report.published import SUCCESS_SHARES, SUCCESS_TOLERANCES
from dnet.evaluation.report.runs import Run, links, read_runs, scores_of, within
from dnet.evaluation.report.values import (
    Cell,
    Claim,
    Column,
    Line,
    LinePlot,
    Panel,
    Section,
    Sheet,
    Values,
)
from dnet.evaluation.servo_scores import MOST, NEAR, Score
from dnet.evaluation.servo_table import summary

TOLERANCES_MM = (1.5, 2.0, 3.0, 5.0)
"""Of the symmetric mean Chamfer distance, told in the table."""
WIDEST_MM, WIDEST_LEGACY = 8.0, 0.5
"""Where curves end."""
_COLUMNS = (
    Column("method"),
    Column("runs", 0),
    Column("not run", 0),
    Column("outcomes"),
    Column("Chamfer, start, mm", 2),
    Column("Chamfer, end, mm", 2),
    Column("floor, mm", 2),
    Column("legacy norm, end", 3),
    Column("nodes off, mm", 2),
    *(Column(f"within {tolerance:g} mm, %", 0) for tolerance in TOLERANCES_MM),
    Column(f"within {NEAR:g} x floor, %", 0),
    Column(f"{MOST:.0%} of the possible, %", 0),
    Column("motions", 0),
)


def goals_section(folder: Path, asked: Asked | None, *, title: str, out: Path) -> Section:
    """Return what the runs of an experiment came to.

    Args:
        folder: Of the experiment.
        asked: What was asked of it; None if it was not run.
        title: Of the section.
        out: Directory of the report.

    Raises:
        DnetError: If a log cannot be read.
    """
    about = (
        "Settled shapes of episodes that no network has seen, in the quasi-static world. Methods "
        "are a controller and, after a plus, a way to choose the grasp; without one, the object is "
        "grasped where the goal was made. `none` never moves, `oracle` knows the true motion, "
        "`rrt` tries motions at random.",
        "The Chamfer distance is the symmetric mean in millimetres; the floor is that between two "
        "samplings of the goal shape, below which nothing can be told apart. The legacy norm is "
        "the figure of the authors' scripts, one-sided and over all goal points. Figures are "
        "medians; shares are of all runs, those that failed or never began among them.",
    )
    if asked is None:
        return Section("goals", title, about, claims=_claims({}, None))
    runs = read_runs(folder, asked)
    scores = {method: scores_of(some) for method, some in runs.items()}
    rows = tuple(table_row(method, some) for method, some in runs.items())
    sheets = (
        Sheet("goals", "Servo runs by method", _COLUMNS, rows),
        _legacy_sheet(scores),
    )
    return Section(
        "goals",
        title,
        about,
        claims=_claims(scores, asked),
        sheets=sheets,
        plots=(
            success_plot("goals-success", scores, legacy=False),
            success_plot("goals-success-legacy", scores, legacy=True),
        ),
        runs=links(runs, out),
    )


def table_row(method: str, runs: Sequence[Run]) -> tuple[Cell, ...]:
    """Return the figures of one method, as the columns name them."""
    scores = scores_of(runs)
    if not scores:
        return (method, 0, len(runs), "", *[None] * (len(_COLUMNS) - 4))
    figures = summary(scores)
    outcomes = Counter(score.outcome for score in scores).most_common()
    medians = [figures[name] for name in ("first_mm", "last_mm", "floor_mm", "legacy_last")]
    shares = [within(scores, tolerance / 1e3) for tolerance in TOLERANCES_MM]
    shares += [
        float(np.mean([score.near for score in scores])),
        float(np.mean([score.most for score in scores])),
    ]
    return (
        method,
        len(scores),
        len(runs) - len(scores),
        ", ".join(f"{count} {outcome}" for outcome, count in outcomes),
        *map(_number, medians),
        _number(figures["nodes_last_mm"]),
        *(100 * share for share in shares),
        _number(figures["motions"]),
    )


def success_plot(name: str, scores: Mapping[str, Sequence[Score]], *, legacy: bool) -> LinePlot:
    """Return the share of goals that each method reaches over the tolerance."""
    known = {method: some for method, some in scores.items() if some}
    lines = tuple(Line(method, *_curve(some, legacy=legacy)) for method, some in known.items())
    return LinePlot(
        name,
        "Goals reached over the tolerance" + (", legacy norm" if legacy else ""),
        "legacy norm at the end (goal to cloud, over all points)"
        if legacy
        else "Chamfer distance at the end, mm",
        "share of all goals",
        (Panel("", lines),),
        steps=True,
    )


def _curve(scores: Sequence[Score], *, legacy: bool) -> tuple[Values, Values]:
    widest = WIDEST_LEGACY if legacy else WIDEST_MM
    last = np.array([one.legacy_last if legacy else 1e3 * one.last for one in scores])
    reached = np.sort(last[last <= widest])  # NaN is not
    shares = np.arange(len(reached) + 1) / len(scores)
    x = np.concatenate([[0.0], reached, [widest]])
    return x, np.concatenate([shares, shares[-1:]])


def _legacy_sheet(scores: Mapping[str, Sequence[Score]]) -> Sheet:
    rows: list[tuple[Cell, ...]] = []
    for method, some in scores.items():
        shares = [100 * within(some, most, legacy=True) for most in SUCCESS_TOLERANCES]
        rows.append((method, *shares))
        if method in SUCCESS_SHARES:
            rows.append((f"{method} (ICRA 2022)", *(100 * one for one in SUCCESS_SHARES[method])))
    columns = (Column("method"), *(Column(f"within {one:g}, %", 0) for one in SUCCESS_TOLERANCES))
    note = (
        "The figures of Thach, Cho, Kuntz and Hermans (ICRA 2022) are of other objects and goals, "
        "and of a network trained on them; they stand here for orientation."
    )
    return Sheet("goals-legacy", "Success within the legacy norm", columns, tuple(rows), note)


def _claims(scores: Mapping[str, Sequence[Score]], asked: Asked | None) -> tuple[Claim, ...]:
    claims = []
    for tolerance, paper in zip(SUCCESS_TOLERANCES, SUCCESS_SHARES["deformernet"], strict=True):
        what = f"DeformerNet: goals within {tolerance:g} of the legacy norm"
        some = scores.get("deformernet")
        if asked is None or not some:
            claims.append(Claim("ICRA 2022", what, f"{paper:.0%}", "", None, "not run"))
            continue
        share = within(some, tolerance, legacy=True)
        reason = "of unseen poses and grasps of one kind of object; theirs are of unseen objects"
        if asked.reduced:
            reason = f"{asked.reduced}; {reason}"
        claims.append(
            Claim("ICRA 2022", what, f"{paper:.0%}", f"{share:.0%}", share >= paper, reason)
        )
    return tuple(claims)


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) else None
