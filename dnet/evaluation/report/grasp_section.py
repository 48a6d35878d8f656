"""How near each method comes to the true manipulation point: table 1 of the paper."""

from pathlib import Path

import numpy as np
import polars as pl

from dnet.errors import BadReport
from dnet.evaluation.report.asked import Asked
from dnet.evaluation.report.published import GRASP_CASES, GRASP_MM, METHODS
from dnet.evaluation.report.values import (
    Cell,
    Claim,
    Column,
    Line,
    LinePlot,
    Panel,
    RunLink,
    Section,
    Sheet,
    Still,
    Values,
)

ANSWERS, PICTURE, RECORDING = "grasp.csv", "grasp.png", "grasp.rrd"
_COLUMNS = (
    Column("method"),
    Column("cases", 0),
    Column("mean, mm", 1),
    Column("paper, mm", 1),
    Column("median, mm", 1),
    Column("90 %, mm", 1),
    Column("worst, mm", 1),
    Column("no answer", 0),
)


def grasp_section(folder: Path, asked: Asked | None, *, title: str, out: Path) -> Section:
    """Return what the choices in a directory came to.

    Args:
        folder: Of the experiment.
        asked: What was asked of it; None if it was not run.
        title: Of the section.
        out: Directory of the report.

    Raises:
        BadReport: If the choices cannot be read.
    """
    found = {} if asked is None else _distances(folder / ANSWERS)
    sheet = Sheet(
        "grasp",
        "Distance of the manipulation point from the truth",
        _COLUMNS,
        tuple(_row(name, *answer) for name, answer in found.items()),
        "A case without an answer counts with the middle of the object as its answer.",
    )
    curves = tuple(Line(name, *_shares(1e3 * distances)) for name, (distances, _) in found.items())
    plot = LinePlot(
        "grasp-curves",
        "Cases within a distance of the true manipulation point",
        "distance from the truth, mm",
        "share of all cases",
        (Panel("", curves),),
        steps=True,
    )
    about = (
        "Each method is shown the rest shape of an unseen episode and one of its other shapes, "
        "and says where to grasp; the truth is the point at which that shape was made.",
    )
    if not found:
        return Section("grasp", title, about, claims=_claims(found, asked))
    picture = folder / PICTURE
    caption = (
        "Best, median and worst case of each method: the initial cloud with the true point (green) "
        "and the chosen one (blue), and the goal. It is figure 3 of the paper but for its results."
    )
    return Section(
        "grasp",
        title,
        about,
        claims=_claims(found, asked),
        sheets=(sheet,),
        plots=(plot,),
        stills=(Still("grasp-cases", caption, picture.read_bytes()),) if picture.is_file() else (),
        runs=(RunLink("all cases", f"{len(found)} methods", _files(folder, out)),),
    )


def _files(folder: Path, out: Path) -> tuple[Path, ...]:
    paths = (folder / name for name in (ANSWERS, RECORDING))
    return tuple(path.relative_to(out) for path in paths if path.is_file())


def _distances(path: Path) -> dict[str, tuple[Values, int]]:
    """Return the distances of each method, in metres, and how many cases it had no answer to."""
    try:
        table = pl.read_csv(path)
        return {
            str(name): (
                rows["distance"].to_numpy().astype(np.float64),
                int(rows["chosen_x"].cast(pl.Float64).is_nan().sum()),
            )
            for (name,), rows in table.group_by("method", maintain_order=True)
        }
    except (OSError, pl.exceptions.PolarsError) as error:
        raise BadReport(path, f"is unreadable ({error})", "run the experiment again") from error


def _row(name: str, distances: Values, unanswered: int) -> tuple[Cell, ...]:
    mm = 1e3 * distances
    figures = (mm.mean(), GRASP_MM.get(name), np.median(mm), np.quantile(mm, 0.9), mm.max())
    told = [None if one is None else float(one) for one in figures]
    return (name, len(mm), *told, unanswered)


def _shares(values: Values) -> tuple[Values, Values]:
    """Return how large a share of the values is at most as large as each of them, from 0."""
    ordered = np.sort(values)
    shares = np.arange(len(ordered) + 1) / max(len(ordered), 1)
    return np.concatenate([[0.0], ordered]), shares


def _claims(found: dict[str, tuple[Values, int]], asked: Asked | None) -> tuple[Claim, ...]:
    claims = []
    for name, paper in GRASP_MM.items():
        what = f"mean distance over {GRASP_CASES} cases, {METHODS[name]}"
        if asked is None or name not in found:
            claims.append(Claim("table 1", what, f"{paper:.0f} mm", "", None, "not run"))
            continue
        mean = 1e3 * float(found[name][0].mean())
        reason = "on episodes that no network learned from"
        if asked.reduced:
            reason = f"{asked.reduced}; {reason}"
        claims.append(
            Claim("table 1", what, f"{paper:.0f} mm", f"{mean:.1f} mm", mean <= paper, reason)
        )
    return tuple(claims)
