"""Where a training's recording has what, and how the viewer lays it out."""

import rerun as rr
import rerun.blueprint as rrb

from dnet.recorders.blueprint import BACKGROUND

STEP_TIMELINE = "step"

SUMMARY, LOSS, RATE = "summary", "loss", "learning_rate"
ERRORS, LOGARITHMS, MOTIONS, WORST = "errors", "log10", "motions", "worst"
PAIRS = "pairs"
MSE, SUM, MEAN, R2 = "mse_mm2", "sum_mm2", "mean_mm", "r2"
AXES = ("x", "y", "z")

SCATTER_BACKGROUND = (16, 18, 22)
SIDE = (-1.02, 1.02)
"""What a scatter shows of x and y, in halves of the side of its frame."""
SAMPLES = 4
"""Worst pairs in the layout."""
EYE, LOOK_AT = (0.045, -0.182, 0.132), (0.005, 0.0, 0.036)
"""From the front and above, as the depth camera stands: the object fills the view."""


def training_layout(sets: int) -> rrb.Blueprint:
    """Return the layout, with room for so many sets in the table.

    A viewer that opens a newer recording of a training keeps its layout: hence all that goes by
    values, such as what the worst pairs are called, is no part of it, and no view comes later.
    """
    samples = [
        rrb.Spatial3DView(
            name=f"Worst pair {number + 1}",
            origin=f"/{WORST}/{number}",
            background=BACKGROUND,
            line_grid=False,
            eye_controls=rrb.EyeControls3D(
                kind=rrb.Eye3DKind.Orbital,
                position=EYE,
                look_target=LOOK_AT,
                eye_up=(0.0, 0.0, 1.0),
            ),
        )
        for number in range(SAMPLES)
    ]
    scatters = [
        rrb.Spatial2DView(
            name=f"Motion along {axis}",
            origin=f"/{MOTIONS}",
            contents=[f"/{MOTIONS}/{axis}/**"],
            background=SCATTER_BACKGROUND,
            visual_bounds=rrb.VisualBounds2D(x_range=SIDE, y_range=SIDE),
        )
        for axis in AXES
    ]
    return rrb.Blueprint(
        rrb.Horizontal(
            _curves_layout(sets),
            rrb.Vertical(*scatters),
            rrb.Grid(*samples, grid_columns=2),
            column_shares=[4.2, 2.4, 5.4],
        ),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=STEP_TIMELINE, play_state="Following"),
        auto_layout=False,
        auto_views=False,
    )


def _curves_layout(sets: int) -> rrb.Container:
    # One legend is enough: the colours are the same everywhere.
    bare = rrb.PlotLegend(visible=False)
    ends = rrb.TimeRangeBoundary.infinite()
    whole = rrb.TimeAxis(view_range=rr.TimeRange(start=ends, end=ends))
    return rrb.Vertical(
        rrb.TextDocumentView(name="Errors now", origin=f"/{SUMMARY}"),
        rrb.TimeSeriesView(
            name="Squared error, mean of x, y, z (log10 of mm²)",
            origin=f"/{LOGARITHMS}",
            plot_legend=rrb.Corner2D.RightTop,
            axis_x=whole,
        ),
        rrb.TimeSeriesView(
            name="Mean error (mm)", origin=f"/{ERRORS}/{MEAN}", plot_legend=bare, axis_x=whole
        ),
        rrb.TimeSeriesView(
            name="R²",
            origin=f"/{ERRORS}/{R2}",
            plot_legend=bare,
            axis_x=whole,
            # Below 0 the mean motion would be a better guess; early epochs may lie far below.
            axis_y=rrb.ScalarAxis(range=(0.0, 1.0)),
        ),
        rrb.TimeSeriesView(name="Learning rate", origin=f"/{RATE}", plot_legend=bare, axis_x=whole),
        row_shares=[0.85 + 0.24 * sets, 2.6, 1.6, 1.6, 0.9],
    )
