"""How a scene is laid out in Rerun: the object and both tools at left, curves and log at right."""

from typing import Literal

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import TextLogColumnKind

from dnet.recorders.frame_columns import GRIPPER
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


Company = Literal["alone", "several"]
"""Whether a recording is seen by itself, or the viewer must list it with others."""

SERVO_APPLICATION, RECORDING_APPLICATION = "dnet servo", "dnet record"
"""Rerun shows all recordings of one application in one layout."""


def servo_blueprint(*, gripper: bool = False, company: Company = "alone") -> rrb.Blueprint:
    """Return the layout of a servo run, with the curves of the gripper if they are logged."""
    curves = {"chamfer": "Chamfer to the goal", "motion": "Predicted motion"}
    return _blueprint(**curves, gripper=gripper, company=company)


def recording_blueprint(*, company: Company = "alone") -> rrb.Blueprint:
    """Return the layout of an episode of random shapes."""
    curves = {"chamfer": "Chamfer to rest", "motion": "Motion from rest"}
    return _blueprint(**curves, gripper=True, company=company)


def _blueprint(*, chamfer: str, motion: str, gripper: bool, company: Company) -> rrb.Blueprint:
    scene = rrb.Spatial3DView(
        name="Scene",
        origin="/",
        contents=["/**", *(f"- /{entity}/**" for entity in (JOINTS, GRIPPER, LOG))],
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
    # The title says what one curve is; a legend would hide a part of it.
    bare = rrb.PlotLegend(visible=False)
    curves = [
        rrb.TimeSeriesView(name=f"{chamfer} (mm)", origin=f"/{CHAMFER}", plot_legend=bare),
        rrb.TimeSeriesView(name=f"{motion} (mm)", origin=f"/{MOTION_LENGTH}", plot_legend=bare),
        *([rrb.TimeSeriesView(name="Gripper (mm)", origin=f"/{GRIPPER}")] if gripper else []),
        # Twelve names would hide the curves; the viewer shows them under the mouse.
        rrb.TimeSeriesView(
            name="Joints (rad, insertion in m)", origin=f"/{JOINTS}", plot_legend=bare
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
            rrb.Vertical(*curves, log, row_shares=[1] * (len(curves) + 1)),
            column_shares=[5, 3],
        ),
        # The panel of the layout holds the list of recordings.
        rrb.BlueprintPanel(state="hidden" if company == "alone" else "expanded"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=TIME_TIMELINE),
        auto_layout=False,
        auto_views=False,
    )
