"""Servo runs compared: a table for people, and the same figures run by run for machines."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict

import numpy as np
import polars as pl

from dnet.evaluation.servo_scores import MOST, NEAR, Score

COLUMNS = (
    "controller",
    "runs",
    "outcomes",
    "Chamfer at the start, mm",
    "Chamfer at the end, mm",
    "floor, mm",
    "legacy norm at the end",
    f"within {NEAR} x floor",
    f">= {MOST:.0%} of the possible",
    "nodes off, mm",
    "motions",
)


def servo_table(found: Iterable[tuple[str, Sequence[Score]]]) -> str:
    """Return a Markdown table, a row a controller: medians, and shares of all runs.

    Args:
        found: The runs by what controlled them.
    """
    lines = [_row(COLUMNS), _row(["---"] * len(COLUMNS))]
    lines += [_row(_cells(name, scores)) for name, scores in found]
    return "\n".join(lines) + "\n"


def servo_frame(found: Iterable[tuple[str, Sequence[Score]]]) -> pl.DataFrame:
    """Return one row a run with all of its figures, distances in metres."""
    rows = [
        {
            "controller": name,
            **asdict(score),
            "improvement": score.improvement,
            "near": score.near,
            "most": score.most,
        }
        for name, scores in found
        for score in scores
    ]
    return pl.DataFrame(rows, infer_schema_length=None)


def summary(scores: Sequence[Score]) -> dict[str, object]:
    """Return the figures of a row, as JSON would have them."""
    count = len(scores)
    return {
        "runs": count,
        "outcomes": dict(sorted(Counter(score.outcome for score in scores).items())),
        "first_mm": _median([1e3 * score.first for score in scores]),
        "last_mm": _median([1e3 * score.last for score in scores]),
        "floor_mm": _median([1e3 * score.floor for score in scores]),
        "legacy_last": _median([score.legacy_last for score in scores]),
        "near": sum(score.near for score in scores) / count,
        "most": sum(score.most for score in scores) / count,
        "nodes_last_mm": _median([1e3 * score.nodes_last for score in scores]),
        "motions": _median([float(score.motions) for score in scores]),
        "step_ms": _median([score.step_ms for score in scores]),
    }


def _cells(name: str, scores: Sequence[Score]) -> list[str]:
    row = summary(scores)
    counts = Counter(score.outcome for score in scores)
    return [
        name,
        str(len(scores)),
        ", ".join(f"{count} {outcome}" for outcome, count in counts.most_common()),
        f"{row['first_mm']:.2f}",
        f"{row['last_mm']:.2f}",
        f"{row['floor_mm']:.2f}",
        f"{row['legacy_last']:.3f}",
        f"{row['near']:.0%}",
        f"{row['most']:.0%}",
        f"{row['nodes_last_mm']:.2f}",
        f"{row['motions']:.0f}",
    ]


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _median(values: Sequence[float]) -> float:
    """Return the median of what is known; NaN if nothing is."""
    known = [value for value in values if np.isfinite(value)]
    return float(np.median(known)) if known else float("nan")
