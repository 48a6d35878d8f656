"""Where to grasp, case by case, as one Rerun recording: choices, truth, heat map, keypoints."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float

from dnet.recorders.blueprint import BACKGROUND
from dnet.recorders.choice import RADIUS, cloud_points, log_keypoint_pairs
from dnet.recorders.recording_file import recording_file
from dnet.recorders.rerun_scene import GOAL_COLOR, POINT_RADIUS
from dnet.recorders.training_layout import EYE, LOOK_AT
from dnet.types import Cloud, KeypointPairs, Point

GRASP_APPLICATION = "dnet evaluate grasp"
CASES = "case"
"""The timeline: one case after another."""
TRUE_COLOR = (60, 220, 90)
CHOICE_COLORS = ((70, 120, 255), (255, 176, 0), (214, 110, 255), (0, 206, 209), (255, 116, 116))
"""Of the methods, in their order; a sixth has the first colour again."""


@dataclass(frozen=True, slots=True)
class GraspCase:
    """Two clouds, and where methods would grasp."""

    name: str
    initial: Cloud
    goal: Cloud
    choices: Mapping[str, Point]
    """Of each method; NaN where it gives no answer."""
    truth: Point | None = None
    heat: Float[np.ndarray, " n"] | None = None
    """How likely each point of the initial cloud is, as a dense method has it."""
    keypoints: KeypointPairs | None = None


def write_grasps(path: Path, cases: Sequence[GraspCase]) -> None:
    """Write cases as the Rerun recording `path`, whole or not at all.

    Args:
        path: An `.rrd`, replaced if it exists.
        cases: One for each step of the timeline.
    """
    layout = _layout(keypoints=any(case.keypoints is not None for case in cases))
    with recording_file(
        path, application=GRASP_APPLICATION, name="where to grasp", blueprint=layout
    ) as recording:
        for number, case in enumerate(cases):
            recording.set_time(CASES, sequence=number)
            _log_case(recording, case)


def _log_case(recording: rr.RecordingStream, case: GraspCase) -> None:
    recording.log("initial/cloud", cloud_points(case.initial, case.heat))
    goal = np.require(case.goal, dtype=np.float32, requirements=["C", "ALIGNED"])
    recording.log("goal/cloud", rr.Points3D(goal, colors=GOAL_COLOR, radii=POINT_RADIUS))
    points = dict(case.choices)
    if case.truth is not None:
        points["truth"] = case.truth
    lines = [f"**{case.name}**", "", "| method | from the truth |", "|---|--:|"]
    for number, (name, point) in enumerate(points.items()):
        known = bool(np.isfinite(point).all())
        color = TRUE_COLOR if name == "truth" else CHOICE_COLORS[number % len(CHOICE_COLORS)]
        marked = rr.Points3D(
            [point] if known else [], labels=[name], show_labels=True, colors=color, radii=RADIUS
        )
        recording.log(rr.new_entity_path(["initial", "choices", name]), marked)
        if name != "truth" and case.truth is not None:
            distance = 1e3 * float(np.linalg.norm(point - case.truth))
            lines.append(f"| {name} | {f'{distance:.1f} mm' if known else 'no answer'} |")
    text = rr.TextDocument("\n".join(lines), media_type=rr.MediaType.MARKDOWN)
    recording.log("about", text)
    if case.keypoints is not None:
        log_keypoint_pairs(recording, case.keypoints, "keypoints")


def _layout(*, keypoints: bool) -> rrb.Blueprint:
    names = {"initial": "Where to grasp", "goal": "Goal"}
    if keypoints:
        names["keypoints"] = "Keypoints, initial to goal"
    views = [
        rrb.Spatial3DView(
            name=name,
            origin=f"/{origin}",
            background=BACKGROUND,
            line_grid=False,
            eye_controls=rrb.EyeControls3D(
                kind=rrb.Eye3DKind.Orbital,
                position=EYE,
                look_target=LOOK_AT,
                eye_up=(0.0, 0.0, 1.0),
            ),
        )
        for origin, name in names.items()
    ]
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(*views),
            rrb.TextDocumentView(name="Case", origin="/about"),
            row_shares=[2.4, 1],
        ),
        rrb.BlueprintPanel(state="hidden"),
        rrb.SelectionPanel(state="hidden"),
        rrb.TimePanel(state="collapsed", timeline=CASES),
        auto_layout=False,
        auto_views=False,
    )
