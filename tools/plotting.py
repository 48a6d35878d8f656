"""One picture to judge a dataset by: its shapes, how far they moved, where they were held."""

from collections.abc import Callable
from io import BytesIO
from pathlib import Path

import numpy as np
from jaxtyping import Float64
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from dnet.datasets.frame_table import settled_frames
from dnet.datasets.index import Index
from dnet.errors import TooFew
from dnet.files.whole_file import write_whole
from dnet.tools.histogram import histogram
from dnet.tools.plotting_shapes import Shapes, spread
from dnet.tools.plotting_sheet import draw_sheet, rows_of
from dnet.tools.statistics_figure import check_picture

SHEETS = 12
MEASURED = 1000
"""Shapes of which the Chamfer distance is measured: each takes some milliseconds."""
CELLS = 40
"""Across the workspace, at most."""

_BLUE, _ORANGE = "#35608d", "#b9770e"
_WIDTH, _SHEET_ROW, _PANELS = 16.0, 2.4, 4.2
"""Of the picture, of a row of shapes and of the row of figures, in inches."""


def plot_dataset(
    index: Index,
    path: Path,
    *,
    sheets: int = SHEETS,
    on_shape: Callable[[int, int], None] = lambda _done, _total: None,
) -> None:
    """Draw shapes of a dataset, how far they are from rest, and where they were held.

    Args:
        index: Of the dataset, or of some of its episodes.
        path: A picture; its ending says which kind. Its directory is made if need be.
        sheets: How many shapes to draw.
        on_shape: Called with the number of shapes measured and of all that will be.

    Raises:
        UnknownPicture: If `path` ends in no kind of picture that we draw.
        TooFew: If `sheets` is below one, or the dataset has no shape other than at rest.
        NoEpisodes: If no file can be read.
        BadEpisode: If clouds differ in their number of points, or two files hold one episode.
        ChangedEpisode: If a file is not the one that was indexed.
    """
    check_picture(path)
    if sheets < 1:
        raise TooFew("number of shapes to draw", sheets, 1)
    shapes = Shapes(settled_frames(index))
    distances = shapes.distances(spread(len(shapes), MEASURED), on_shape=on_shape)
    content = BytesIO()
    ending = path.suffix.lower()
    # Without dates and random names the same data give the same bytes. A $ is no formula.
    dated = {".pdf": {"CreationDate": None}, ".svg": {"Date": None}}
    with rc_context({"svg.hashsalt": "dnet", "text.parse_math": False}):
        figure = _draw(shapes, distances, sheets)
        figure.savefig(content, format=ending[1:], dpi=110, metadata=dated.get(ending))
    write_whole(path, content.getvalue())


def _draw(shapes: Shapes, distances: Float64[np.ndarray, "_"], sheets: int) -> Figure:
    shown = [shapes.shape(number) for number in spread(len(shapes), sheets).tolist()]
    above = _SHEET_ROW * rows_of(len(shown))
    # No pyplot: a figure of its own draws without a screen and leaves nothing behind.
    figure = Figure(figsize=(_WIDTH, above + _PANELS + 0.6), layout="constrained")
    episodes = len(set(shapes.table.file.tolist()))
    figure.suptitle(
        f"{shapes.table.root}: {episodes} episodes, {len(shapes)} shapes, "
        f"{shapes.table.points} points each",
        fontsize="x-large",
    )
    sheet, figures = figure.subfigures(2, 1, squeeze=False, height_ratios=[above, _PANELS]).ravel()
    draw_sheet(sheet, shown)
    moved, far, top, side = figures.subplots(1, 4)
    lengths = 1e3 * np.linalg.norm(shapes.motions, axis=1)
    _draw_histogram(moved, lengths, "displacement of the grasp from rest (mm)", _BLUE)
    _draw_histogram(far, 1e3 * distances, "Chamfer distance from the rest shape (mm)", _ORANGE)
    moved.set_title("how far the grasp moved", fontsize="medium")
    measured = "" if len(distances) == len(shapes) else f" ({len(distances)} shapes)"
    far.set_title(f"how far the shape changed{measured}", fontsize="medium")
    _draw_coverage(top, 1e3 * shapes.grasps, "x", "y")
    _draw_coverage(side, 1e3 * shapes.grasps, "x", "z")
    top.set_title("where the grasp was, from above", fontsize="medium")
    side.set_title("where the grasp was, from the side", fontsize="medium")
    return figure


def _draw_histogram(panel: Axes, values: Float64[np.ndarray, "_"], what: str, color: str) -> None:
    bins = histogram(values, most=int(np.clip(2 * np.sqrt(len(values)), 10, 50)))
    starts = bins.start + bins.width * np.arange(len(bins.counts))
    panel.bar(starts, bins.counts, bins.width, align="edge", color=color, edgecolor="white")
    middle = float(np.median(values))
    panel.axvline(middle, color="black", linewidth=1.2)
    panel.set(xlabel=what, ylabel=f"shapes in {bins.width:g} mm")
    panel.set_xlim(left=0)
    panel.spines[["top", "right"]].set_visible(False)
    panel.text(
        middle,
        1.0,
        f" median {middle:.3g} mm",
        transform=panel.get_xaxis_transform(),
        va="top",
    )


def _draw_coverage(panel: Axes, grasps: Float64[np.ndarray, "_ 3"], across: str, up: str) -> None:
    width = max(histogram(values, most=CELLS).width for values in grasps.T)
    x, y = (grasps[:, "xyz".index(axis)] for axis in (across, up))
    edges = [
        width * np.arange(np.floor(values.min() / width), np.floor(values.max() / width) + 2)
        for values in (x, y)
    ]
    # Empty cells stay white, so that gaps in the workspace are seen.
    *_, drawn = panel.hist2d(x, y, bins=edges, cmin=1, vmin=0, cmap="viridis")
    label = f"shapes in {width:g} mm x {width:g} mm"
    panel.figure.colorbar(
        drawn, ax=panel, label=label, shrink=0.8, ticks=MaxNLocator(6, integer=True)
    )
    panel.set(xlabel=f"{across} (mm)", ylabel=f"{up} (mm)", aspect="equal", facecolor="#f4f4f4")
