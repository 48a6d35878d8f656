"""Plots as plotly draws them in a page: hover, zoom, turn; without a network."""

from typing import Any

import numpy as np

from dnet.errors import MissingExtra
from dnet.evaluation.report.palette import FAINT, INK, RULE, strokes
from dnet.evaluation.report.values import BarPlot, LinePlot, Plot, SpacePlot

HEIGHT, SPACE_HEIGHT, BAR_HEIGHT = 420, 520, 34
_FONT = {"family": "system-ui, sans-serif", "size": 13, "color": INK}


def plotly_library() -> str:
    """Return plotly's JavaScript, to be put into a page once.

    Raises:
        MissingExtra: If plotly is not there.
    """
    offline = _plotly("offline")
    return str(offline.get_plotlyjs())


def plotly_html(plot: Plot) -> str:
    """Return a plot as a piece of a page that holds plotly's JavaScript: always the same.

    Raises:
        MissingExtra: If plotly is not there.
    """
    objects = _plotly("graph_objects")
    match plot:
        case LinePlot():
            figure = _lines(plot, objects)
        case BarPlot():
            figure = _bars(plot, objects)
        case SpacePlot():
            figure = _space(plot, objects)
    figure.update_layout(
        template="none",
        font=_FONT,
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
        hoverlabel={"bgcolor": "white", "font": _FONT},
        legend={"itemsizing": "constant"},
        modebar={"bgcolor": "rgba(0,0,0,0)", "color": FAINT, "activecolor": INK},
    )
    return str(
        figure.to_html(
            full_html=False,
            include_plotlyjs=False,
            include_mathjax=False,
            div_id=f"plot-{plot.name}",
            config={"displaylogo": False, "responsive": True},
        )
    )


def _lines(plot: LinePlot, objects: Any) -> Any:
    subplots = _plotly("subplots")
    figure = subplots.make_subplots(
        cols=len(plot.panels),
        shared_yaxes=True,
        horizontal_spacing=0.03,
        subplot_titles=[panel.title for panel in plot.panels],
    )
    labels = [line.label for panel in plot.panels for line in panel.lines]
    drawn = dict(zip(labels, strokes(labels), strict=True))
    shown: set[str] = set()
    for column, panel in enumerate(plot.panels, start=1):
        for line in panel.lines:
            stroke = drawn[line.label]
            trace = objects.Scatter(
                x=_rounded(line.x),
                y=_rounded(line.y),
                name=line.label,
                legendgroup=line.label,
                showlegend=line.label not in shown,
                mode="lines" if plot.steps else "lines+markers",
                line={
                    "color": stroke.colour,
                    "dash": stroke.dash,
                    "width": 2,
                    "shape": "hv" if plot.steps else "linear",
                },
                marker={"size": 5},
            )
            shown.add(line.label)
            figure.add_trace(trace, row=1, col=column)
        figure.update_xaxes(title_text=plot.x, row=1, col=column)
    figure.update_yaxes(title_text=plot.y, row=1, col=1)
    figure.update_xaxes(rangemode="tozero", **_AXIS)
    figure.update_yaxes(rangemode="tozero", **_AXIS)
    if plot.steps:
        figure.update_yaxes(range=[0, 1.02], tickformat=".0%")
    above = 60 if any(panel.title for panel in plot.panels) else 30
    figure.update_layout(height=HEIGHT, margin={"l": 70, "r": 20, "t": above, "b": 60})
    return figure


def _bars(plot: BarPlot, objects: Any) -> Any:
    groups = list(dict.fromkeys(bar.group for bar in plot.bars))
    figure = objects.Figure()
    for group, stroke in zip(groups, strokes(groups), strict=True):
        some = [bar for bar in plot.bars if bar.group == group]
        figure.add_trace(
            objects.Bar(
                y=[bar.label for bar in some],
                x=_rounded(np.array([bar.value for bar in some])),
                orientation="h",
                error_x={
                    "type": "data",
                    "symmetric": False,
                    "array": _rounded(np.array([bar.high - bar.value for bar in some])),
                    "arrayminus": _rounded(np.array([bar.value - bar.low for bar in some])),
                    "color": FAINT,
                    "thickness": 1.5,
                },
                name=group,
                marker={"color": stroke.colour},
            )
        )
    order = [bar.label for bar in plot.bars][::-1]
    figure.update_yaxes(categoryorder="array", categoryarray=order, automargin=True, **_AXIS)
    scale = {"type": "log"} if plot.logarithmic else {"rangemode": "tozero"}
    figure.update_xaxes(title_text=plot.x, **scale, **_AXIS)
    figure.update_layout(
        height=BAR_HEIGHT * len(order) + 110,
        margin={"l": 70, "r": 20, "t": 30, "b": 60},
        bargap=0.35,
        barmode="overlay",
        showlegend=len(groups) > 1,
    )
    return figure


def _space(plot: SpacePlot, objects: Any) -> Any:
    figure = objects.Figure()
    drawn = strokes([marks.label for marks in plot.marks])
    for marks, stroke in zip(plot.marks, drawn, strict=True):
        x, y, z = (_rounded(axis) for axis in 1e3 * marks.points.astype(np.float64).T)
        figure.add_trace(
            objects.Scatter3d(
                x=x,
                y=y,
                z=z,
                name=marks.label,
                mode="markers",
                marker={"size": marks.size, "color": stroke.colour},
            )
        )
    axes = {f"{axis}axis": {"title": {"text": f"{axis}, mm"}, **_AXIS} for axis in "xyz"}
    scene = {
        "aspectmode": "data",
        "camera": {"eye": {"x": 0.6, "y": -2.0, "z": 1.3}},
        **axes,
    }
    figure.update_layout(
        height=SPACE_HEIGHT, scene=scene, margin={"l": 10, "r": 10, "t": 40, "b": 10}
    )
    return figure


_AXIS = {"gridcolor": RULE, "linecolor": FAINT, "zerolinecolor": RULE, "showgrid": True}


def _rounded(values: Any) -> list[float]:
    """Return numbers that are as exact as a screen, in few letters."""
    return [float(f"{value:.5g}") for value in np.asarray(values, dtype=np.float64)]


def _plotly(part: str) -> Any:
    from importlib import import_module  # noqa: PLC0415

    try:
        return import_module(f"plotly.{part}")
    except ImportError as error:
        raise MissingExtra("plotly", "report", "a report with plots") from error
