"""How a scene is laid out in Rerun: the object and both tools at left, curves and log at right."""

from collections.abc import Mapping, Sequence
from typing import Literal

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint.encodings import TextLogColumnKind

from dnet.recorders.choice import CHOICE
from dnet.recorders.frame_columns import GRIPPER
from dnet.recorders.link_rows import WORLD, placed
from dnet.recorders.rerun_scene import (
    CHAMFER,
    GOAL,
    JOINTS,
    LATENCY,
    LEGACY,
    LOG,
    MOTION_LENGTH,
    NODES,
    TIME_TIMELINE,
    drawn_at,
)
from dnet.types import ARMS

PLOTTED = (CHOICE, JOINTS, GRIPPER, LOG, CHAMFER, NODES, LEGACY, MOTION_LENGTH, LATENCY)
"""What has no place in the scene, but views of its own."""
EYE = (0.045, -0.275, 0.155)
"""From the front and a little above, as the depth camera stands: the object fills the view."""
LOOK_AT = (0.005, 0.0, 0.045)
BACKGROUND = (22, 24, 30)


Company = Literal["alone", "several", "film"]
"""Whether a recording is seen by itself, the viewer must list it with others, or a film of its
scene is taken."""
FILM_GOAL = (214, 218, 228)
"""Colour of the goal in a film: pale, for the object is of all colours, green among them."""
FILM_GOAL_RADIUS = 0.0006

SERVO_APPLICATION, RECORDING_APPLICATION = "dnet servo", "dnet record"
COMPARISON_APPLICATION = "dnet servo side by side"
"""Rerun shows all recordings of one application in one layout."""


def servo_blueprint(
    *, gripper: bool = False, choice: bool = False, company: Company = "alone"
) -> rrb.Blueprint:
    """Return the layout of a servo run.

    With the curves of the gripper, and with where the object is grasped, if they are logged.

    At right what the run is about, how far the shape is from its goal, comes first and is largest;
    then what was asked for and what was done; what only some want to know waits in tabs.
    """
    if company == "film":
        return _film_blueprint()
    curves: list[rrb.View | rrb.Container] = [
        _plot("Chamfer to the goal (mm), grey: its floor", CHAMFER),
        rrb.Horizontal(
            _plot("Nodes off (mm)", NODES), _plot("Legacy norm", LEGACY), column_shares=[1, 1]
        ),
        rrb.Tabs(
            _plot("Predicted motion (mm)", MOTION_LENGTH),
            *([_gripper()] if gripper else [_plot("Latency (ms)", LATENCY, legend=True)]),
            _joints(),
        ),
    ]
    scene: rrb.View | rrb.Container = _view()
    if choice:
        scene = rrb.Tabs(_view(), _choice(), active_tab=0)
    return _blueprint(curves, scene=scene, shares=[3, 2, 2, 3], company=company)


def recording_blueprint(*, company: Company = "alone") -> rrb.Blueprint:
    """Return the layout of an episode of random shapes."""
    curves = [
        _plot("Chamfer to rest (mm)", CHAMFER),
        _plot("Motion from rest (mm)", MOTION_LENGTH),
        _gripper(),
        _joints(),
    ]
    return _blueprint(curves, scene=_view(), shares=[1] * 5, company=company)


def _film_blueprint() -> rrb.Blueprint:
    """Return the scene alone, without words in it: a film says them beside it."""
    goal = rr.Points3D.from_fields(colors=FILM_GOAL, radii=FILM_GOAL_RADIUS)
    view = _view(hidden=(f"{GOAL}/label",), overrides={GOAL: goal})
    return rrb.Blueprint(
        view,
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="hidden", timeline=TIME_TIMELINE),
        auto_layout=False,
        auto_views=False,
    )


def _plot(name: str, entity: str, *, legend: bool = False) -> rrb.TimeSeriesView:
    # The title says what one curve is; a legend would hide a part of it.
    return rrb.TimeSeriesView(
        name=name, origin=f"/{entity}", plot_legend=rrb.PlotLegend(visible=legend)
    )


def _gripper() -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(name="Gripper (mm)", origin=f"/{GRIPPER}")


def _joints() -> rrb.TimeSeriesView:
    # Twelve names would hide the curves; the viewer shows them under the mouse.
    return _plot("Joints (rad, insertion in m)", JOINTS)


def _blueprint(
    curves: Sequence[rrb.View | rrb.Container],
    *,
    scene: rrb.View | rrb.Container,
    shares: Sequence[int],
    company: Company,
) -> rrb.Blueprint:
    return _arranged(
        rrb.Horizontal(
            scene,
            rrb.Vertical(*curves, _log(), row_shares=list(shares)),
            column_shares=[5, 3],
        ),
        company=company,
    )


def comparison_blueprint(titles: Mapping[str, str]) -> rrb.Blueprint:
    """Return the layout of several servo runs side by side.

    Args:
        titles: What each is called, by where its scene hangs.
    """
    columns = [
        rrb.Vertical(
            _view(title, place=place),
            _plot("Chamfer to the goal (mm), grey: its floor", placed(place, CHAMFER)),
            _plot("Nodes off (mm)", placed(place, NODES)),
            _log(place),
            row_shares=[6, 2, 1, 2],
        )
        for place, title in titles.items()
    ]
    return _arranged(rrb.Horizontal(*columns), company="alone")


def _view(
    name: str = "Scene",
    *,
    place: str = "",
    hidden: Sequence[str] = (),
    overrides: Mapping[str, rr.Points3D] | None = None,
) -> rrb.Spatial3DView:
    shown = [f"/{place}/**", *(f"/{drawn_at(place, arm)}/**" for arm in ARMS)] if place else ["/**"]
    return rrb.Spatial3DView(
        name=name,
        origin="/",
        contents=[*shown, *(f"- /{placed(place, entity)}/**" for entity in (*PLOTTED, *hidden))],
        overrides={f"/{entity}": looks for entity, looks in (overrides or {}).items()},
        # The arms' boxes and cylinders would be wire frames.
        defaults=[
            rr.Boxes3D.from_fields(fill_mode="solid"),
            rr.Cylinders3D.from_fields(fill_mode="solid"),
        ],
        background=BACKGROUND,
        line_grid=False,
        spatial_information=rrb.SpatialInformation(target_frame=WORLD),
        eye_controls=_eye(),
    )


def _choice() -> rrb.Spatial3DView:
    return rrb.Spatial3DView(
        name="Where to grasp",
        origin="/",
        contents=[f"/{CHOICE}/**"],
        background=BACKGROUND,
        line_grid=False,
        spatial_information=rrb.SpatialInformation(target_frame=WORLD),
        eye_controls=_eye(),
    )


def _eye() -> rrb.EyeControls3D:
    return rrb.EyeControls3D(
        kind=rrb.Eye3DKind.Orbital, position=EYE, look_target=LOOK_AT, eye_up=(0.0, 0.0, 1.0)
    )


def _log(place: str = "") -> rrb.TextLogView:
    return rrb.TextLogView(
        name="Log",
        origin=f"/{placed(place, LOG)}",
        columns=rrb.TextLogColumns(
            timeline_columns=[TIME_TIMELINE],
            text_log_columns=[TextLogColumnKind.Body],
        ),
    )


def _arranged(layout: rrb.Container, *, company: Company) -> rrb.Blueprint:
    return rrb.Blueprint(
        layout,
        # The panel of the layout holds the list of recordings.
        rrb.BlueprintPanel(state="hidden" if company == "alone" else "expanded"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=TIME_TIMELINE),
        auto_layout=False,
        auto_views=False,
    )
