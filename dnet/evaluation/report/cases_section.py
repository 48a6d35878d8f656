"""The four servo cases of the paper: table 2, and figures 3 to 6."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from dnet.evaluation.report.asked import Asked
from dnet.evaluation.report.cases_claims import cases_claims
from dnet.evaluation.report.cases_stories import Stories, Story, read_story
from dnet.evaluation.report.published import FINAL_CHAMFER, METHODS
from dnet.evaluation.report.runs import Run, links, read_runs
from dnet.evaluation.report.scene_stills import draw_result, draw_sequence, draw_setup
from dnet.evaluation.report.values import (
    Cell,
    Column,
    Line,
    LinePlot,
    Marks,
    Panel,
    Section,
    Sheet,
    SpacePlot,
    Still,
)

SHOWN = 500
"""Points of a cloud that is to be turned about in the page."""
_COLUMNS = (
    Column("case"),
    Column("goal"),
    Column("method"),
    Column("outcome"),
    Column("motions", 0),
    Column("point off, mm", 1),
    Column("Chamfer, start, mm", 2),
    Column("Chamfer, end, mm", 2),
    Column("floor, mm", 2),
    Column("nodes off, mm", 2),
    Column("legacy norm, end", 3),
    Column("paper, legacy norm", 2),
)


def cases_section(folder: Path, asked: Asked | None, *, title: str, out: Path) -> Section:
    """Return what the runs of the cases came to.

    Args:
        folder: Of the experiment.
        asked: What was asked of it; None if it was not run.
        title: Of the section.
        out: Directory of the report.

    Raises:
        DnetError: If a log cannot be read.
    """
    about = (
        "Four pairs of an initial and a goal shape, drawn from seeds that nothing was chosen by; "
        "DeformerNet drives, and each of the paper's two methods chooses the manipulation point. "
        "The paper's `Chamfer distance [m]` is the legacy norm: one-sided, from the goal to the "
        "current cloud, and the norm over all goal points, not their mean. The paper's pairs are "
        "not public, so that its cases and ours are not the same.",
    )
    if asked is None:
        return Section("cases", title, about, claims=cases_claims({}, {}, None))
    runs = read_runs(folder, asked)
    stories = {method: [read_story(run) for run in some] for method, some in runs.items()}
    return Section(
        "cases",
        title,
        about,
        claims=cases_claims(runs, stories, asked),
        sheets=(_sheet(runs, stories),),
        plots=(_over_time(stories), *_spaces(stories)),
        stills=_stills(stories),
        runs=links(runs, out),
    )


def _sheet(runs: Mapping[str, Sequence[Run]], stories: Stories) -> Sheet:
    rows: list[tuple[Cell, ...]] = []
    for number in range(max(map(len, runs.values()), default=0)):
        for method, some in runs.items():
            score, story = some[number].score, stories[method][number]
            paper = FINAL_CHAMFER.get(method, ())
            published = paper[number] if number < len(paper) else None
            case = f"case {number + 1}"
            if score is None:
                rows.append((case, "", method, "not run", *[None] * 7, published))
                continue
            off = None if story is None else _off_mm(story)
            rows.append(
                (
                    case,
                    score.goal,
                    method,
                    score.outcome,
                    score.motions,
                    off,
                    *(1e3 * one for one in (score.first, score.last, score.floor)),
                    1e3 * score.nodes_last,
                    score.legacy_last,
                    published,
                )
            )
    return Sheet("cases", "Final distances to the goal", _COLUMNS, tuple(rows))


def _off_mm(story: Story) -> float:
    return 1e3 * float(np.linalg.norm(story.chosen - story.truth))


def _over_time(stories: Stories) -> LinePlot:
    cases = max(map(len, stories.values()), default=0)
    panels = tuple(
        Panel(
            f"case {number + 1}",
            tuple(
                Line(method, story.times, story.distances_mm)
                for method, some in stories.items()
                if (story := some[number]) is not None
            ),
        )
        for number in range(cases)
    )
    return LinePlot(
        "cases-over-time",
        "Chamfer distance over time (figure 6 of the paper)",
        "time, s",
        "Chamfer distance, mm",
        panels,
    )


def _spaces(stories: Stories) -> list[SpacePlot]:
    """Return the shapes of each case to turn about, of the first method that has a run."""
    plots = []
    for number in range(max(map(len, stories.values()), default=0)):
        told = ((method, some[number]) for method, some in stories.items())
        for method, story in told:
            if story is None:
                continue
            marks = (
                Marks("start", story.shots[0].cloud[:SHOWN]),
                Marks("goal", story.goal[:SHOWN]),
                Marks("end", story.shots[-1].cloud[:SHOWN]),
                Marks("true point", story.truth[None], 7),
                Marks("chosen point", story.chosen[None], 7),
            )
            title = f"Case {number + 1} in space, {method}"
            plots.append(SpacePlot(f"cases-space-{number + 1}", title, marks))
            break
    return plots


def _stills(stories: Stories) -> tuple[Still, ...]:
    stills: list[Still] = []
    told = [
        (method, number, story)
        for method, some in stories.items()
        for number, story in enumerate(some, start=1)
        if story is not None
    ]
    for number in sorted({number for _, number, _ in told}):
        mine = [(method, story) for method, at, story in told if at == number]
        first = mine[0][1]
        png = draw_result(
            initial=first.shots[0],
            goal=first.goal,
            ends=[(method, story.shots[-1], story.chosen) for method, story in mine],
            truth=first.truth,
        )
        caption = (
            f"Figure 3, case {number}: initial and goal shape; the chosen point (blue) and the "
            "true one (green); results, with the goal as sparse red points."
        )
        stills.append(Still(f"cases-result-{number}", caption, png))
    if told:
        caption = (
            "Figure 4, the set-up: the left arm holds one end of the object, the right arm moves "
            "the manipulation point."
        )
        stills.append(Still("cases-setup", caption, draw_setup(told[0][2].shots[0])))
    for method, number, story in told:
        distances = [float(story.distances_mm[index]) for index in story.shown]
        caption = (
            f"Figure 5, case {number}, {METHODS.get(method, method)}: key frames, each with its "
            "time and its Chamfer distance; the goal as sparse red points."
        )
        png = draw_sequence(story.shots, story.goal, distances)
        name = method.replace(",", "").replace(" ", "-")
        stills.append(Still(f"cases-sequence-{number}-{name}", caption, png))
    return tuple(stills)
