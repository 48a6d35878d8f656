"""How a scene is laid out in Rerun: the object and both tools at left, curves and log at right."""

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import TextLogColumnKind

from dnet.recorders.rerun_scene import (
    CHAMFER,
    JOINTS,
    LOG,
    MOTION_LENGTH,
    TIME_TIMELINE,
    WORLD,
)

EYE = (0.045, -0.275, 0.155)
"""From the front and a little above, as the depth camera stands: the object fills the view."""
LOOK_AT = (0.005, 0.0, 0.045)
BACKGROUND = (22, 24, 30)


SERVO_APPLICATION, RECORDING_APPLICATION = "dnet servo", "dnet record"
"""Rerun shows all recordings of one application in one layout."""


def servo_blueprint() -> rrb.Blueprint:
    """Return the layout of a servo run."""
    return _blueprint(chamfer="Chamfer to the goal", motion="Predicted motion")


def recording_blueprint() -> rrb.Blueprint:
    """Return the layout of an episode of random shapes."""
    return _blueprint(chamfer="Chamfer to the last shape", motion="Motion from rest")


def _blueprint(*, chamfer: str, motion: str) -> rrb.Blueprint:
    scene = rrb.Spatial3DView(
        name="Scene",
        origin="/",
        contents=["/**", f"- /{JOINTS}/**", f"- /{LOG}/**"],
        # The arms' boxes and cylinders would be wire frames.
        defaults=[
            rr.Boxes3D.from_fields(fill_mode="solid"),
            rr.Cylinders3D.from_fields(fill_mode="solid"),
        ],
        background=BACKGROUND,
        line_grid=False,
        spatial_information=rrb.SpatialInformation(target_frame=WORLD),
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital,
            position=EYE,
            look_target=LOOK_AT,
            eye_up=(0.0, 0.0, 1.0),
        ),
    )
    curves = [
        rrb.TimeSeriesView(name=chamfer, origin=f"/{CHAMFER}"),
        rrb.TimeSeriesView(name=motion, origin=f"/{MOTION_LENGTH}"),
        # Twelve names would hide the curves; the viewer shows them under the mouse.
        rrb.TimeSeriesView(
            name="Joints (rad, insertion in m)",
            origin=f"/{JOINTS}",
            plot_legend=rrb.PlotLegend(visible=False),
        ),
    ]
    log = rrb.TextLogView(
        name="Log",
        origin=f"/{LOG}",
        columns=rrb.TextLogColumns(
            timeline_columns=[TIME_TIMELINE],
            text_log_columns=[TextLogColumnKind.Body],
        ),
    )
    return rrb.Blueprint(
        rrb.Horizontal(
            scene,
            rrb.Vertical(*curves, log, row_shares=[3, 3, 3, 3]),
            column_shares=[5, 3],
        ),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=TIME_TIMELINE),
        auto_layout=False,
        auto_views=False,
    )
