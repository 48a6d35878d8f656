"""The figures of a recording as one picture."""

from io import BytesIO
from pathlib import Path

import numpy as np
from jaxtyping import Float64
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, Rectangle

from dnet.errors import UnknownPicture
from dnet.files.whole_file import write_whole
from dnet.tools.histogram import histogram
from dnet.tools.statistics import AXES, SCENE
from dnet.tools.statistics_recorded import Recorded
from dnet.tools.statistics_values import Draws, Statistics

FORMATS = (".png", ".pdf", ".svg")
LEAST_DENSITY = 2000
"""Shapes from which on cells are counted; fewer are drawn one by one."""

_COLORS = {"x": "#c0392b", "y": "#27803b", "z": "#2a5caa", "length": "#555555"}
_Points = Float64[np.ndarray, "_ 3"]


def check_picture(path: Path) -> None:
    """Refuse a picture that cannot be drawn, before anything else is done.

    Raises:
        UnknownPicture: If `path` ends in none of `FORMATS`.
    """
    if path.suffix.lower() not in FORMATS:
        raise UnknownPicture(path, FORMATS)


def draw_statistics(index: Recorded, figures: Statistics, path: Path) -> None:
    """Draw where shapes and manipulation points lie and what was rejected.

    Args:
        index: Of the recording.
        figures: Of the same.
        path: A picture; its ending says which kind. Its directory is made if need be.

    Raises:
        UnknownPicture: If `path` ends in none of `FORMATS`.
    """
    check_picture(path)
    content = BytesIO()
    ending = path.suffix.lower()
    # Without dates and random names the same figures give the same bytes. A $ is no formula.
    dated = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
    with rc_context({"svg.hashsalt": "dnet", "text.parse_math": False}):
        figure = _draw(index, figures)
        figure.savefig(content, format=ending[1:], dpi=100, metadata=dated.get(ending))
    write_whole(path, content.getvalue())


def _draw(index: Recorded, figures: Statistics) -> Figure:
    shapes = index.frames.filter(index.frames["kind"] == "shape")
    moved = shapes.select(AXES).to_numpy()
    # No pyplot: a figure of its own draws without a screen and leaves nothing behind.
    figure = Figure(figsize=(16, 8), layout="constrained")
    panels = figure.subplots(2, 4)
    columns = {axis: moved[:, column] for column, axis in enumerate(AXES)}
    columns["length"] = np.linalg.norm(moved, axis=1)
    for panel, (name, values) in zip(panels[0], columns.items(), strict=True):
        _draw_histogram(panel, name, values)
    _draw_density(panels[1, 0], moved, "x", "y")
    _draw_density(panels[1, 1], moved, "x", "z")
    _draw_grasps(panels[1, 2], index)
    _draw_rejected(panels[1, 3], figures.draws)
    figure.suptitle(
        f"{figures.directory}: {figures.files.finished} episodes, {figures.frames['shape']} shapes"
    )
    return figure


def _draw_histogram(panel: Axes, name: str, values: Float64[np.ndarray, "_"]) -> None:
    bins = histogram(values, most=int(np.clip(2 * np.sqrt(len(values)), 10, 60)))
    starts = bins.start + bins.width * np.arange(len(bins.counts))
    panel.bar(starts, bins.counts, bins.width, align="edge", color=_COLORS[name])
    what = name if name == "length" else f"along {name}"
    panel.set(xlabel=f"displacement from rest, {what} (mm)", ylabel=f"shapes in {bins.width:g} mm")


def _draw_density(panel: Axes, moved: _Points, across: str, up: str) -> None:
    panel.set(xlabel=f"displacement along {across} (mm)", ylabel=f"along {up} (mm)", aspect="equal")
    if not len(moved):
        return
    x, y = moved[:, AXES.index(across)], moved[:, AXES.index(up)]
    if len(moved) < LEAST_DENSITY:
        panel.scatter(x, y, s=8, color="#35608d")
    else:
        width = max(histogram(values, most=50).width for values in moved.T)
        edges = [
            width * np.arange(np.floor(values.min() / width), np.floor(values.max() / width) + 2)
            for values in (x, y)
        ]
        *_, drawn = panel.hist2d(x, y, bins=edges, cmin=1, vmin=0, cmap="viridis")
        label = f"shapes in {width:g} mm x {width:g} mm"
        panel.figure.colorbar(drawn, ax=panel, label=label, shrink=0.8)
    panel.plot(0, 0, "+", color="#c0392b", markersize=14, markeredgewidth=2, clip_on=False)


def _draw_grasps(panel: Axes, index: Recorded) -> None:
    """Draw the manipulation points from above, with the outlines of the objects at rest."""
    outlines = index.episodes.select("shape", "size_x", "size_y").unique(maintain_order=True)
    for shape, length, width in outlines.iter_rows():
        outline = (
            Ellipse((0, 0), length, width, fill=False)
            if shape == "hemi_ellipsoid"
            else Rectangle((-length / 2, -width / 2), length, width, fill=False)
        )
        outline.set_alpha(max(0.1, 1 / outlines.height))
        panel.add_patch(outline)
    for (shape,), episodes in index.episodes.sort("shape").group_by("shape", maintain_order=True):
        panel.scatter(episodes["x"], episodes["y"], s=14, label=f"{shape}, {episodes.height}")
    panel.set(xlabel="along the object, held at its left (mm)", ylabel="across it (mm)")
    panel.set_aspect("equal")
    panel.set_title("manipulation points from above", fontsize="medium")
    # Nothing is grasped near the held end.
    panel.legend(loc="center left", fontsize="small")


def _draw_rejected(panel: Axes, draws: Draws | None) -> None:
    panel.set(xlabel="share of draws (%)")
    if draws is None:
        panel.set_title("nothing is known of rejected draws", fontsize="medium")
        return
    panel.set_title(
        f"{draws.rejected_shapes} of {draws.shapes} drawn shapes rejected", fontsize="medium"
    )
    rows = draws.rejected[::-1]
    bars = panel.barh(
        [row.reason for row in rows],
        [100 * row.share for row in rows],
        color=["#999999" if row.reason == SCENE else "#b9770e" for row in rows],
    )
    counts = [
        f"{row.count} of {draws.scenes}" if row.reason == SCENE else str(row.count) for row in rows
    ]
    panel.bar_label(bars, counts, padding=3)
    panel.set_xlim(0, 170 * max([row.share for row in rows], default=0.0) or 1)
