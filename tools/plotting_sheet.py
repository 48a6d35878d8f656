"""A contact sheet of shapes: small pictures side by side, all at one scale from one side."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float64
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import SubFigure

from dnet.tools.plotting_shapes import Shape
from dnet.types import Cloud

COLUMNS = 6
TURN, TILT = np.radians(-24.0), np.radians(28.0)
"""Seen from the front, a little from the right and from above."""
REST_COLOR, GRASP_COLOR = "#c3c6cc", "#d1432b"
HEIGHTS = ListedColormap(colormaps["viridis"](np.linspace(0.0, 0.9, 256)))
"""Without the pale end: it would be lost on white."""
SCALE_MM = 50

_Flat = Float64[np.ndarray, "_ 3"]


def rows_of(count: int) -> int:
    """Return how many rows so many pictures take."""
    return math.ceil(count / COLUMNS)


def draw_sheet(figure: SubFigure, shapes: Sequence[Shape]) -> None:
    """Draw shapes coloured by height, before their rest shapes in grey.

    Args:
        figure: What to draw into.
        shapes: One or more.
    """
    columns = min(COLUMNS, len(shapes))
    panels = figure.subplots(rows_of(len(shapes)), columns, squeeze=False).flatten()
    seen = [(project(one.cloud), project(one.rest)) for one in shapes]
    corners = np.concatenate([points[:, :2] for both in seen for points in both])
    low, high = corners.min(axis=0), corners.max(axis=0)
    margin = 0.02 * (high - low).max() + 1e-3
    heights = np.concatenate([one.cloud[:, 2] for one in shapes])
    colors = Normalize(0.0, max(1.0, 1e3 * float(heights.max())))
    for panel, one, (cloud, rest) in zip(panels, shapes, seen, strict=False):
        _draw_points(panel, rest, color=REST_COLOR)
        # What is near hides what is far.
        order = np.argsort(-cloud[:, 2], kind="stable")
        _draw_points(panel, cloud[order], c=1e3 * one.cloud[order, 2], norm=colors, cmap=HEIGHTS)
        _draw_motion(panel, one)
        length = 1e3 * float(np.linalg.norm(one.motion))
        panel.set_title(f"{one.name}\n{length:.1f} mm", fontsize=9, pad=2)
    for panel in panels:
        panel.set(
            xlim=(1e3 * (low[0] - margin), 1e3 * (high[0] + margin)),
            ylim=(1e3 * (low[1] - margin), 1e3 * (high[1] + margin)),
            aspect="equal",
        )
        panel.set_axis_off()
    _draw_scale(panels[0], 1e3 * (low - margin), 1e3 * (high - low + 2 * margin))
    bar = figure.colorbar(
        panels[0].collections[1], ax=panels.tolist(), shrink=0.75, aspect=30, pad=0.01
    )
    bar.set_label("height above the table (mm)")
    figure.suptitle(
        "shapes spread evenly over the dataset, each before its rest shape (grey); the arrow is "
        "the motion of the grasp since rest",
        fontsize="medium",
    )


def project(points: Cloud | _Flat) -> _Flat:
    """Return points as they are seen: to the right, up, and away from the eye, in metres."""
    x, y, z = np.asarray(points, np.float64).T
    across = np.cos(TURN) * x - np.sin(TURN) * y
    along = np.sin(TURN) * x + np.cos(TURN) * y
    up = np.cos(TILT) * z + np.sin(TILT) * along
    away = np.cos(TILT) * along - np.sin(TILT) * z
    return np.stack([across, up, away], axis=1)


def _draw_points(panel: Axes, points: _Flat, **look: Any) -> None:
    # In a PDF thousands of points are better a picture than thousands of circles.
    across, up, _ = 1e3 * points.T
    panel.scatter(across, up, s=2.2, linewidths=0, rasterized=True, **look)


def _draw_motion(panel: Axes, one: Shape) -> None:
    start, end = 1e3 * project(np.stack([one.grasp - one.motion, one.grasp]))[:, :2]
    arrow = {"arrowstyle": "-|>", "color": GRASP_COLOR, "linewidth": 1.6, "shrinkA": 0}
    panel.annotate("", end, start, arrowprops={**arrow, "shrinkB": 0, "mutation_scale": 11})
    panel.plot(*start, "o", color="white", markeredgecolor=GRASP_COLOR, markersize=4)


def _draw_scale(panel: Axes, corner: np.ndarray, size: np.ndarray) -> None:
    """Draw a length to measure by; across the picture nothing is foreshortened."""
    left, bottom = corner + 0.04 * size
    panel.plot([left, left + SCALE_MM], [bottom, bottom], color="black", linewidth=2)
    panel.text(left + SCALE_MM / 2, bottom + 2, f"{SCALE_MM} mm", ha="center", fontsize=8)
