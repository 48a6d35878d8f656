"""How a training went as one Rerun recording: its curves, its motions and its worst pairs."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import rerun as rr
from jaxtyping import Float

from dnet.recorders.recording_file import recording_file
from dnet.recorders.rerun_scene import CURRENT_COLOR, GOAL_COLOR, POINT_COLOR, POINT_RADIUS
from dnet.recorders.training_curves import Curves
from dnet.recorders.training_layout import SUMMARY, WORST, training_layout
from dnet.recorders.training_scatters import NAME_COLOR, log_scatters
from dnet.recorders.training_values import (
    EpochPoint,
    LossPoint,
    Motions,
    RatePoint,
    WorstSample,
)

TRAINING_APPLICATION = "dnet train"
SET_COLORS = ((255, 176, 0), (214, 110, 255), (0, 206, 209), (255, 116, 116))
"""Of the sets, in the order in which they first come; a fifth has the first colour again."""
TRUE_COLOR, PREDICTED_COLOR = (150, 255, 150), (255, 110, 40)
CAPTION = (0.005, 0.0, 0.108)
"""Where a worst pair says which it is: above all that the object can be."""


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

    A viewer that opens it again after an epoch adds what is new. Values that are not finite leave
    gaps.

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
    layout = training_layout(max(2, len(epochs[-1].errors) if epochs else 0))
    with recording_file(
        path, application=TRAINING_APPLICATION, name=name, blueprint=layout
    ) as recording:
        curves = Curves(recording)
        curves.send_losses(losses)
        curves.send_rates(rates)
        curves.send_errors(epochs, colors)
        table = _table(epochs[-1]) if epochs else "No epoch is done yet."
        document = rr.TextDocument(table, media_type=rr.MediaType.MARKDOWN)
        recording.log(SUMMARY, document, static=True)
        if motions:
            log_scatters(recording, motions, colors)
        for number, sample in enumerate(worst):
            _log_sample(recording, f"{WORST}/{number}", sample)


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
