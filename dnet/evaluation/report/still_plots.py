"""The same plots as pictures, for where no page is shown."""

from io import BytesIO
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D

from dnet.evaluation.report.palette import INK, RULE, strokes
from dnet.evaluation.report.values import BarPlot, LinePlot, Plot, SpacePlot

_DASHES = {"solid": "-", "dash": "--", "dot": ":"}
_STYLE: Any = {
    "text.parse_math": False,
    "axes.edgecolor": INK,
    "axes.grid": True,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "grid.color": RULE,
    "font.size": 9,
}


def draw_plot(plot: Plot) -> bytes:
    """Return a plot as a PNG; the same plot, the same bytes."""
    with rc_context(_STYLE):
        match plot:
            case LinePlot():
                figure = _lines(plot)
            case BarPlot():
                figure = _bars(plot)
            case SpacePlot():
                figure = _space(plot)
        return png_of(figure)


def png_of(figure: Figure, *, dpi: int = 110) -> bytes:
    """Return a drawn figure as a PNG without a date or a version in it."""
    content = BytesIO()
    figure.savefig(content, format="png", dpi=dpi, metadata={"Software": None})
    return content.getvalue()


def _lines(plot: LinePlot) -> Figure:
    count = len(plot.panels)
    figure = Figure(figsize=(7.5 if count == 1 else 3.2 * count, 3.6), layout="constrained")
    fields = figure.subplots(1, count, sharey=True, squeeze=False)[0]
    labels = [line.label for panel in plot.panels for line in panel.lines]
    drawn = dict(zip(labels, strokes(labels), strict=True))
    for axes, panel in zip(fields, plot.panels, strict=True):
        for line in panel.lines:
            stroke = drawn[line.label]
            axes.plot(
                line.x,
                line.y,
                color=stroke.colour,
                linestyle=_DASHES[stroke.dash],
                drawstyle="steps-post" if plot.steps else "default",
                marker="" if plot.steps else ".",
                label=line.label,
            )
        axes.set(xlabel=plot.x, title=panel.title, xlim=(0, None), ylim=(0, None))
    fields[0].set_ylabel(plot.y)
    handles = {line.get_label(): line for axes in fields for line in axes.get_lines()}
    if handles:
        figure.legend(handles.values(), handles.keys(), loc="outside right upper", frameon=False)
    return figure


def _bars(plot: BarPlot) -> Figure:
    figure = Figure(figsize=(7.5, 0.6 + 0.32 * max(len(plot.bars), 3)), layout="constrained")
    axes = figure.subplots()
    groups = list(dict.fromkeys(bar.group for bar in plot.bars))
    colours = {group: stroke.colour for group, stroke in zip(groups, strokes(groups), strict=True)}
    for place, bar in enumerate(plot.bars):
        axes.barh(place, np.nan_to_num(bar.value), height=0.6, color=colours[bar.group])
        axes.plot([bar.low, bar.high], [place, place], color=INK, linewidth=1)
    axes.set_yticks(range(len(plot.bars)), [bar.label for bar in plot.bars])
    axes.invert_yaxis()
    axes.set_axisbelow(True)
    if plot.logarithmic:
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter("{x:g}")
    axes.set_xlabel(plot.x)
    return figure


def _space(plot: SpacePlot) -> Figure:
    figure = Figure(figsize=(6, 4), layout="constrained")
    axes = figure.add_subplot(projection="3d")
    if not isinstance(axes, Axes3D):
        raise TypeError(axes)
    drawn = strokes([marks.label for marks in plot.marks])
    for marks, stroke in zip(plot.marks, drawn, strict=True):
        axes.scatter(
            *(1e3 * marks.points.T),
            s=marks.size**2,
            c=stroke.colour,
            label=marks.label,
            linewidths=0,
        )
    axes.set(xlabel="x, mm", ylabel="y, mm", zlabel="z, mm")
    axes.set_aspect("equal")
    axes.view_init(elev=35, azim=-70)
    axes.legend(frameon=False, markerscale=0.8)
    return figure
