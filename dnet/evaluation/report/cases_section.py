"""The four servo cases of the paper: table 2, and figures 3 to 6."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dnet.datasets.reader import EpisodeReader
from dnet.evaluation.report.asked import Asked
from dnet.evaluation.report.published import FINAL_CHAMFER, HU_CHAMFER
from dnet.evaluation.report.runs import Run, links, read_runs
from dnet.evaluation.report.scene_stills import draw_result, draw_sequence, draw_setup
from dnet.evaluation.report.snapshot import Snapshot, snapshot
from dnet.evaluation.report.values import (
    Cell,
    Claim,
    Column,
    Line,
    LinePlot,
    Marks,
    Panel,
    Section,
    Sheet,
    SpacePlot,
    Still,
    Values,
)
from dnet.evaluation.servo_scores import RUN, Score
from dnet.geometry.chamfer import chamfer
from dnet.types import Cloud, Point

FRAMES = 5
"""Key frames of a sequence, the first and the last among them."""
SHOWN = 500
"""Points of a cloud that is to be turned about in the page."""
HU_TRUE_POINT = "hu, true point"
NAMES = {"keypoints": "keypoint method", "regressor": "PointConv method"}
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
        return Section("cases", title, about, claims=_claims({}, {}, None))
    runs = read_runs(folder, asked)
    stories = {method: [_read(run) for run in some] for method, some in runs.items()}
    return Section(
        "cases",
        title,
        about,
        claims=_claims(runs, stories, asked),
        sheets=(_sheet(runs, stories),),
        plots=(_over_time(stories), *_spaces(stories)),
        stills=_stills(stories),
        runs=links(runs, out),
    )


def _read(run: Run) -> Story | None:
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


def _sheet(
    runs: Mapping[str, Sequence[Run]], stories: Mapping[str, Sequence[Story | None]]
) -> Sheet:
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


def _over_time(stories: Mapping[str, Sequence[Story | None]]) -> LinePlot:
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


def _spaces(stories: Mapping[str, Sequence[Story | None]]) -> list[SpacePlot]:
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


def _stills(stories: Mapping[str, Sequence[Story | None]]) -> tuple[Still, ...]:
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
            f"Figure 5, case {number}, {NAMES.get(method, method)}: key frames, each with its time "
            "and its Chamfer distance; the goal as sparse red points."
        )
        png = draw_sequence(story.shots, story.goal, distances)
        name = method.replace(",", "").replace(" ", "-")
        stills.append(Still(f"cases-sequence-{number}-{name}", caption, png))
    return tuple(stills)


def _claims(
    runs: Mapping[str, Sequence[Run]],
    stories: Mapping[str, Sequence[Story | None]],
    asked: Asked | None,
) -> tuple[Claim, ...]:
    claims = []
    for method, published in FINAL_CHAMFER.items():
        some = runs.get(method, ())
        for number, paper in enumerate(published):
            what = f"final Chamfer distance, case {number + 1}, {NAMES[method]} (legacy norm)"
            score = some[number].score if number < len(some) else None
            if score is None:
                reason = "not run" if asked is None else asked.reduced or "not carried out"
                claims.append(Claim("table 2", what, f"{paper:.2f}", "", None, reason))
                continue
            reason = (
                f"{score.outcome}, {1e3 * score.last:.2f} mm symmetric mean; another goal than the "
                "paper's"
            )
            ours = f"{score.legacy_last:.2f}" if np.isfinite(score.legacy_last) else score.outcome
            claims.append(
                Claim(
                    "table 2", what, f"{paper:.2f}", ours, bool(score.legacy_last <= paper), reason
                )
            )
    own = {method: stories.get(method, ()) for method in FINAL_CHAMFER if method in stories}
    return (*claims, _hu(runs.get(HU_TRUE_POINT, ()), asked), *_figures(own, asked))


def _hu(runs: Sequence[Run], asked: Asked | None) -> Claim:
    """Return whether the controller of Hu et al. fails, as the paper has it."""
    what = "Hu et al. with the true point: final Chamfer distance (legacy norm) of all four cases"
    paper = f"> {HU_CHAMFER:g}"
    scores = [run.score for run in runs if run.score is not None]
    if not scores:
        reason = "not run" if asked is None else "not carried out"
        return Claim("section III", what, paper, "", None, reason)
    # A run that could not end anywhere is no better than one that ended far off.
    far = [not score.legacy_last <= HU_CHAMFER for score in scores]
    ours = ", ".join(f"{score.legacy_last:.2f}" for score in scores)
    reason = "a baseline: met if it fails as in the paper; Hu-style, the network that is given"
    if asked is not None and asked.reduced:
        reason = f"{asked.reduced}; {reason}"
    return Claim("section III", what, paper, ours, all(far), reason)


def _figures(
    stories: Mapping[str, Sequence[Story | None]], asked: Asked | None
) -> tuple[Claim, ...]:
    """Return the figures that are pictures, and the one that is a curve."""
    told = [story for some in stories.values() for story in some if story is not None]
    asked_for = sum(map(len, stories.values()))
    shows = (
        ("figure 3", "initial and goal shapes, manipulation points and results of four cases"),
        ("figure 4", "the set-up: two da Vinci arms and a soft box"),
        ("figure 5", "key frames of each sequence"),
    )
    fall = "the Chamfer distance over time falls in every case"
    if not told:
        reason = "not run" if asked is None else "no run was carried out"
        figures = [Claim(where, what, "shown", "", None, reason) for where, what in shows]
        return (*figures, Claim("figure 6", fall, "falls", "", None, reason))
    reason = (
        "of PyBullet, drawn from the logs"
        if asked and asked.options.get("world") == "bullet"
        else "of the quasi-static world, drawn from the logs"
    )
    if asked is not None and asked.reduced:
        reason = f"{asked.reduced}; {reason}"
    there, whole = f"{len(told)} of {asked_for} runs", len(told) == asked_for
    # The set-up is the same in all of them.
    shown = {"figure 4": ("shown", True)}
    figures = [
        Claim(where, what, "shown", *shown.get(where, (there, whole)), reason)
        for where, what in shows
    ]
    falls = [bool(story.distances_mm[-1] < story.distances_mm[0]) for story in told]
    left = np.median([story.distances_mm[-1] / story.distances_mm[0] for story in told])
    ours = f"falls in {sum(falls)} of {asked_for} runs, to {left:.0%} (median)"
    return (*figures, Claim("figure 6", fall, "falls", ours, sum(falls) == asked_for, reason))
