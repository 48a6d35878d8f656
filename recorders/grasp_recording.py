"""Where to grasp, case by case, as one Rerun recording: choices, truth, heat map, keypoints."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float
from matplotlib import colormaps

from dnet.recorders.blueprint import BACKGROUND
from dnet.recorders.recording_file import recording_file
from dnet.recorders.rerun_scene import CURRENT_COLOR, GOAL_COLOR, POINT_RADIUS
from dnet.recorders.training_layout import EYE, LOOK_AT
from dnet.types import Cloud, Point

GRASP_APPLICATION = "dnet evaluate grasp"
CASES = "case"
"""The timeline: one case after another."""
TRUE_COLOR = (60, 220, 90)
CHOICE_COLORS = ((70, 120, 255), (255, 176, 0), (214, 110, 255), (0, 206, 209), (255, 116, 116))
"""Of the methods, in their order; a sixth has the first colour again."""
RADIUS = 0.0028


@dataclass(frozen=True, slots=True)
class KeypointPairs:
    """Keypoints of an object in two clouds; row k of both is the same point of it."""

    initial: Float[np.ndarray, "k 3"]
    """In metres."""
    goal: Float[np.ndarray, "k 3"]
    """In metres."""
    weights: Float[np.ndarray, " k"]
    """How much each counts for the choice; 0 for most."""


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
    colors = CURRENT_COLOR if case.heat is None else _heat_colors(case.heat)
    recording.log("initial/cloud", _points(case.initial, colors))
    recording.log("goal/cloud", _points(case.goal, GOAL_COLOR))
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
        _log_keypoints(recording, case.keypoints)


def _log_keypoints(recording: rr.RecordingStream, pairs: KeypointPairs) -> None:
    """Log keypoints in both clouds, lines between matching ones, and those that count."""
    moved = np.linalg.norm(pairs.goal - pairs.initial, axis=1)
    colors = _heat_colors(moved)
    labels = [str(number) for number in range(len(moved))]
    for entity, places in (("initial", pairs.initial), ("goal", pairs.goal)):
        recording.log(
            f"keypoints/{entity}",
            rr.Points3D(places, colors=colors, radii=0.0012, labels=labels, show_labels=False),
        )
    strips = np.stack([pairs.initial, pairs.goal], axis=1)
    recording.log("keypoints/lines", rr.LineStrips3D(strips, colors=colors, radii=0.0003))
    chosen = pairs.weights > 0
    sizes = 0.001 + 0.002 * pairs.weights[chosen] / pairs.weights.max()
    marked = rr.Points3D(pairs.initial[chosen], colors=TRUE_COLOR, radii=sizes)
    recording.log("keypoints/chosen", marked)


def _points(cloud: Cloud, colors: object) -> rr.Points3D:
    points = np.require(cloud, dtype=np.float32, requirements=["C", "ALIGNED"])
    return rr.Points3D(points, colors=colors, radii=POINT_RADIUS)  # type: ignore[arg-type]


def _heat_colors(values: Float[np.ndarray, " n"]) -> np.ndarray:
    """Return a colour for each value, the brightest for the greatest."""
    top = values.max(initial=0.0)
    shares = values / top if top > 0 else values
    return (255 * colormaps["inferno"](0.25 + 0.75 * shares)[:, :3]).astype(np.uint8)


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
