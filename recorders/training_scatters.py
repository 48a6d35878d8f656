"""Predicted against true motions, one scatter for each axis."""

from collections.abc import Mapping, Sequence

import numpy as np
import rerun as rr

from dnet.recorders.training_layout import AXES, MOTIONS, PAIRS
from dnet.recorders.training_values import Motions

FRAME_COLOR, NAME_COLOR = (110, 114, 126), (214, 216, 222)
ROOM = 1.1
"""Half the side of a scatter's frame over the largest true motion."""


def log_scatters(
    recording: rr.RecordingStream,
    motions: Sequence[Motions],
    colors: Mapping[str, tuple[int, int, int]],
) -> None:
    """Log the scatters, those of each set in its colour."""
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
