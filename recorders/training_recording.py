"""How a training went as one Rerun recording: its curves, its motions and its worst pairs."""

import hashlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float, Float32, Float64

from dnet.recorders.blueprint import BACKGROUND
from dnet.recorders.rerun_scene import CURRENT_COLOR, GOAL_COLOR, POINT_COLOR, POINT_RADIUS
from dnet.types import Cloud, Point

TRAINING_APPLICATION = "dnet train"
STEP_TIMELINE = "step"

SUMMARY, LOSS, RATE = "summary", "loss", "learning_rate"
ERRORS, LOGARITHMS, MOTIONS, WORST = "errors", "log10", "motions", "worst"
PAIRS = "pairs"
MSE, SUM, MEAN, R2 = "mse_mm2", "sum_mm2", "mean_mm", "r2"
AXES = ("x", "y", "z")

LOSS_COLOR, RATE_COLOR = (128, 134, 150), (92, 158, 255)
FRAME_COLOR, NAME_COLOR = (110, 114, 126), (214, 216, 222)
SET_COLORS = ((255, 176, 0), (214, 110, 255), (0, 206, 209), (255, 116, 116))
"""Of the sets, in the order in which they first come; a fifth has the first colour again."""
TRUE_COLOR, PREDICTED_COLOR = (150, 255, 150), (255, 110, 40)
SCATTER_BACKGROUND = (16, 18, 22)

ROOM = 1.1
"""Half the side of a scatter's frame over the largest true motion."""
SIDE = (-1.02, 1.02)
"""What a scatter shows of x and y, in halves of the side of its frame."""
SAMPLES = 4
"""Worst pairs in the layout."""
EYE, LOOK_AT = (0.045, -0.182, 0.132), (0.005, 0.0, 0.036)
"""From the front and above, as the depth camera stands: the object fills the view."""
CAPTION = (0.005, 0.0, 0.108)
"""Where a worst pair says which it is: above all that the object can be."""


@dataclass(frozen=True, slots=True)
class LossPoint:
    """One point of the curve of losses."""

    step: int
    """Batches since the training began."""
    loss_mm2: float
    """Squared error of the batch, or its mean over some batches up to this one, in square
    millimetres: the mean over pairs and over x, y, z, as `SetErrors.mse_mm2`."""


@dataclass(frozen=True, slots=True)
class RatePoint:
    """The learning rate at one step."""

    step: int
    """Batches since the training began."""
    rate: float
    """The learning rate, above 0."""


@dataclass(frozen=True, slots=True)
class SetErrors:
    """Errors over the pairs of one set."""

    mse_mm2: float
    """Squared error, mean over pairs and over x, y, z, in square millimetres."""
    mean_mm: float
    """Mean Euclidean error in millimetres."""
    r2: float | None
    """Share of the variance of the motions that is explained; None if they do not vary."""

    @property
    def sum_mm2(self) -> float:
        """Squared error, mean over pairs and summed over x, y, z, in square millimetres."""
        return 3 * self.mse_mm2


@dataclass(frozen=True, slots=True)
class EpochPoint:
    """How good the network was after one epoch."""

    step: int
    """Batches since the training began."""
    errors: Mapping[str, SetErrors]
    """Errors by the names of the sets, such as "unseen shapes"; other epochs may have others."""


@dataclass(frozen=True, slots=True)
class Motions:
    """Predicted and true motions of some pairs of one set, in metres."""

    name: str
    """Of the set; one that is among the errors, too, has the same colour."""
    predicted: Float32[np.ndarray, "p 3"]
    true: Float32[np.ndarray, "p 3"]


@dataclass(frozen=True, slots=True)
class WorstSample:
    """A pair whose motion was predicted badly, in metres and the world frame."""

    caption: str
    """Which pair it is, for people."""
    current: Cloud
    goal: Cloud
    grasp: Point
    """Where the moving arm holds the object at `current`."""
    true: Point
    """Displacement of the grasp that leads to `goal`."""
    predicted: Point
    error_mm: float
    """Euclidean distance of the predicted from the true motion, in millimetres."""


def write_training(
    path: Path,
    *,
    name: str,
    losses: Sequence[LossPoint],
    rates: Sequence[RatePoint],
    epochs: Sequence[EpochPoint],
    motions: Sequence[Motions],
    worst: Sequence[WorstSample],
) -> None:
    """Write how a training went so far as the Rerun recording `path`, in place of an older one.

    It is written as `path` + ".part" and renamed, so that whoever opens `path` finds a whole
    recording. The same training at the same place always has the same recording id: a viewer that
    opens it again after an epoch adds what is new. Values that are not finite leave gaps.

    Args:
        path: Where the recording goes, an `.rrd`.
        name: What the viewer calls it.
        losses: The curve of losses, by ascending step.
        rates: The curve of the learning rate, by ascending step.
        epochs: Errors after each epoch, by ascending step.
        motions: Motions as the network predicts them now, one scatter for each axis.
        worst: Pairs with the largest errors now, the worst first; the layout shows four.
    """
    colors = _colors(epochs, motions)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(path.name + ".part")
    recording = rr.RecordingStream(
        TRAINING_APPLICATION,
        recording_id=hashlib.sha256(f"{name}\n{path.resolve()}".encode()).hexdigest()[:32],
        # They would tell when the file was written.
        send_properties=False,
    )
    recording.set_log_time_enabled(False)
    try:
        try:
            sets = max(2, len(epochs[-1].errors) if epochs else 0)
            recording.save(part, default_blueprint=_blueprint(sets))
            recording.send_recording_name(name)
            curves = _Curves(recording)
            curves.send_losses(losses)
            curves.send_rates(rates)
            curves.send_errors(epochs, colors)
            table = _table(epochs[-1]) if epochs else "No epoch is done yet."
            document = rr.TextDocument(table, media_type=rr.MediaType.MARKDOWN)
            recording.log(SUMMARY, document, static=True)
            if motions:
                _log_scatters(recording, motions, colors)
            for number, sample in enumerate(worst):
                _log_sample(recording, f"{WORST}/{number}", sample)
        finally:
            recording.flush()
            recording.disconnect()
        with part.open("rb") as file:
            os.fsync(file.fileno())
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


class _Curves:
    """Sends whole curves over the steps of the training."""

    def __init__(self, recording: rr.RecordingStream) -> None:
        self._recording = recording

    def send_losses(self, losses: Sequence[LossPoint]) -> None:
        steps = [point.step for point in losses]
        values = [point.loss_mm2 for point in losses]
        style: list[rr.AsComponents] = [
            rr.SeriesLines(names="batches", colors=LOSS_COLOR, widths=1)
        ]
        self._send([LOSS], steps, values, style)
        self._send([LOGARITHMS, LOSS], steps, _log10(values), style)

    def send_rates(self, rates: Sequence[RatePoint]) -> None:
        style: list[rr.AsComponents] = [
            rr.SeriesLines(names="learning rate", colors=RATE_COLOR, widths=2),
            rr.SeriesPoints(
                names="learning rate", colors=RATE_COLOR, markers="circle", marker_sizes=2
            ),
        ]
        self._send([RATE], [p.step for p in rates], [p.rate for p in rates], style)

    def send_errors(
        self, epochs: Sequence[EpochPoint], colors: Mapping[str, tuple[int, int, int]]
    ) -> None:
        for name, color in colors.items():
            judged = [(one.step, one.errors[name]) for one in epochs if name in one.errors]
            steps = [step for step, _ in judged]
            errors = [error for _, error in judged]
            squares = [error.mse_mm2 for error in errors]
            style: list[rr.AsComponents] = [
                rr.SeriesLines(names=name, colors=color, widths=2),
                # The first epoch makes no line yet.
                rr.SeriesPoints(names=name, colors=color, markers="circle", marker_sizes=3),
            ]
            self._send([ERRORS, MSE, name], steps, squares, style)
            self._send([ERRORS, SUM, name], steps, [error.sum_mm2 for error in errors], style)
            self._send([ERRORS, MEAN, name], steps, [error.mean_mm for error in errors], style)
            shares = [np.nan if error.r2 is None else error.r2 for error in errors]
            self._send([ERRORS, R2, name], steps, shares, style)
            self._send([LOGARITHMS, MSE, name], steps, _log10(squares), style)

    def _send(
        self,
        entity: list[str],
        steps: Sequence[int],
        values: Sequence[float] | Float64[np.ndarray, " n"],
        styles: list[rr.AsComponents],
    ) -> None:
        if not len(values):
            return
        place = rr.new_entity_path(entity)
        self._recording.log(place, *styles, static=True)
        self._recording.send_columns(
            place,
            indexes=[rr.TimeColumn(STEP_TIMELINE, sequence=np.array(steps, dtype=np.int64))],
            columns=rr.Scalars.columns(scalars=_finite(values)),
        )


def _finite(values: Sequence[float] | Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " n"]:
    """Return `values` with NaN for what a plot cannot show."""
    found = np.array(values, dtype=np.float64)
    return np.where(np.isfinite(found), found, np.nan)


def _log10(values: Sequence[float]) -> Float64[np.ndarray, " n"]:
    """Return logarithms, for the viewer has no logarithmic axis; NaN where there is none."""
    found = np.array(values, dtype=np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        return _finite(np.log10(found))


def _colors(
    epochs: Sequence[EpochPoint], motions: Sequence[Motions]
) -> dict[str, tuple[int, int, int]]:
    """Return a colour for each set that is named anywhere."""
    named = [name for epoch in epochs for name in epoch.errors] + [one.name for one in motions]
    return {
        name: SET_COLORS[number % len(SET_COLORS)]
        for number, name in enumerate(dict.fromkeys(named))
    }


def _table(epoch: EpochPoint) -> str:
    lines = [
        f"| after step {epoch.step} | mean error | MSE | MSE, xyz summed | R² |",
        "|---|---|---|---|---|",
    ]
    for name, error in epoch.errors.items():
        share = "–" if error.r2 is None else f"{error.r2:.3f}"
        lines.append(
            f"| {name} | **{error.mean_mm:.2f} mm** | {error.mse_mm2:.3g} mm² | "
            f"{error.sum_mm2:.3g} mm² | {share} |"
        )
    return "\n".join(lines)


def _log_scatters(
    recording: rr.RecordingStream,
    motions: Sequence[Motions],
    colors: Mapping[str, tuple[int, int, int]],
) -> None:
    half = _half_side(motions)
    for number, axis in enumerate(AXES):
        root = f"{MOTIONS}/{axis}"
        # The frame fills the view whatever its side is; two-dimensional views have y downwards.
        fitted = rr.Transform3D(scale=[1 / half, -1 / half, 1.0])
        recording.log(root, fitted, static=True)
        _log_frame(recording, root, half)
        for order, one in enumerate(sorted(motions, key=_mean_error, reverse=True)):
            columns = (one.true[:, number], one.predicted[:, number])
            # Lengths that overflow in millimetres are no more finite than infinite ones.
            with np.errstate(over="ignore"):
                pairs = np.float32(1e3) * np.stack(columns, axis=1)
            points = rr.Points2D(
                pairs[np.isfinite(pairs).all(axis=1)],
                colors=colors[one.name],
                radii=rr.Radius.ui_points(1.4),
                # The wider band lies below.
                draw_order=50.0 + order,
            )
            recording.log(rr.new_entity_path([MOTIONS, axis, PAIRS, one.name]), points, static=True)


def _log_frame(recording: rr.RecordingStream, root: str, half: float) -> None:
    """Log the axes of a scatter, and the diagonal, where predicted is true."""
    corners = [[-half, -half], [half, -half], [half, half], [-half, half], [-half, -half]]
    strips = [corners, [[-half, 0], [half, 0]], [[0, -half], [0, half]]]
    thin = rr.Radius.ui_points(0.5)
    axes = rr.LineStrips2D(strips, colors=FRAME_COLOR, radii=thin)
    recording.log(f"{root}/frame", axes, static=True)
    diagonal = rr.LineStrips2D([[[-half, -half], [half, half]]], colors=NAME_COLOR, radii=thin)
    recording.log(f"{root}/diagonal", diagonal, static=True)
    names = rr.Points2D(
        [[0.6 * half, -0.78 * half], [-0.6 * half, 0.92 * half]],
        labels=[f"true, to {half:.3g} mm", "predicted"],
        show_labels=True,
        colors=NAME_COLOR,
        radii=0,
    )
    recording.log(f"{root}/names", names, static=True)


def _mean_error(motions: Motions) -> float:
    errors = np.subtract(motions.predicted, motions.true, dtype=np.float64)
    distances = np.linalg.norm(errors, axis=1)
    finite = distances[np.isfinite(distances)]
    return float(finite.mean()) if finite.size else np.inf


def _half_side(motions: Sequence[Motions]) -> float:
    """Return what the axes go up to, in millimetres: a diverged network is not to set it."""
    lengths = [np.abs(one.true[np.isfinite(one.true)]) for one in motions]
    longest = max((float(values.max()) for values in lengths if values.size), default=0.0)
    return ROOM * 1e3 * longest if longest else 1.0


def _log_sample(recording: rr.RecordingStream, root: str, sample: WorstSample) -> None:
    for entity, cloud, color, side in (
        ("current", sample.current, CURRENT_COLOR, -1),
        ("goal", sample.goal, GOAL_COLOR, 1),
    ):
        points = np.require(cloud, dtype=np.float32, requirements=["C", "ALIGNED"])
        drawn = rr.Points3D(points, colors=color, radii=POINT_RADIUS)
        recording.log(f"{root}/{entity}", drawn, static=True)
        # At the lowest corner, away from the arrows.
        corner = points[(side * points[:, 0] - points[:, 2]).argmax()] if len(points) else None
        _log_name(recording, f"{root}/{entity}", corner, text=entity, color=color)
    grasp = rr.Points3D([sample.grasp], colors=POINT_COLOR, radii=0.0025)
    recording.log(f"{root}/grasp", grasp, static=True)
    for entity, motion, color in (
        ("true", sample.true, TRUE_COLOR),
        ("predicted", sample.predicted, PREDICTED_COLOR),
    ):
        known = bool(np.isfinite(motion).all())
        arrow = rr.Arrows3D(
            origins=[sample.grasp] if known else [],
            vectors=[motion] if known else [],
            colors=color,
            radii=0.0022,
        )
        recording.log(f"{root}/{entity}", arrow, static=True)
        # In the middle of the arrow, where the viewer has its labels, it would hide it.
        tip = sample.grasp + 1.15 * motion if known else None
        _log_name(recording, f"{root}/{entity}", tip, text=entity, color=color)
    caption = f"{sample.caption}: {sample.error_mm:.1f} mm off"
    _log_name(recording, root, np.array(CAPTION), text=caption, color=NAME_COLOR)


def _log_name(
    recording: rr.RecordingStream,
    entity: str,
    place: Float[np.ndarray, "3"] | None,
    *,
    text: str,
    color: tuple[int, int, int],
) -> None:
    label = rr.Points3D(
        [] if place is None else [place], labels=[text], show_labels=True, colors=color, radii=0
    )
    recording.log(f"{entity}/name", label, static=True)


def _blueprint(sets: int) -> rrb.Blueprint:
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
