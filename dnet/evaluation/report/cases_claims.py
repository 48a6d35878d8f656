"""What the paper says of its four servo cases, beside what ours came to."""

from collections.abc import Mapping, Sequence

import numpy as np

from dnet.evaluation.report.asked import Asked
from dnet.evaluation.report.cases_stories import Stories
from dnet.evaluation.report.published import FINAL_CHAMFER, HU_CHAMFER, METHODS
from dnet.evaluation.report.runs import Run
from dnet.evaluation.report.values import Claim

HU_TRUE_POINT = "hu, true point"
"""The method that the paper compares with."""


def cases_claims(
    runs: Mapping[str, Sequence[Run]],
    stories: Stories,
    asked: Asked | None,
) -> tuple[Claim, ...]:
    """Return table 2, what is said of the controller of Hu et al., and the figures 3 to 6."""
    claims = []
    for method, published in FINAL_CHAMFER.items():
        some = runs.get(method, ())
        for number, paper in enumerate(published):
            what = f"final Chamfer distance, case {number + 1}, {METHODS[method]} (legacy norm)"
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


def _figures(stories: Stories, asked: Asked | None) -> tuple[Claim, ...]:
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
