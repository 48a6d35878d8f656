"""Whole curves over the steps of a training."""

from collections.abc import Mapping, Sequence

import numpy as np
import rerun as rr
from jaxtyping import Float64

from dnet.recorders.training_layout import (
    ERRORS,
    LOGARITHMS,
    LOSS,
    MEAN,
    MSE,
    R2,
    RATE,
    STEP_TIMELINE,
    SUM,
)
from dnet.recorders.training_values import EpochPoint, LossPoint, RatePoint

LOSS_COLOR, RATE_COLOR = (128, 134, 150), (92, 158, 255)


class Curves:
    """Sends whole curves over the steps of the training."""

    def __init__(self, recording: rr.RecordingStream) -> None:
        self._recording = recording

    def send_losses(self, losses: Sequence[LossPoint]) -> None:
        """Send the curve of the losses of batches, as they are and as logarithms."""
        steps = [point.step for point in losses]
        values = [point.loss for point in losses]
        style: list[rr.AsComponents] = [
            rr.SeriesLines(names="batches", colors=LOSS_COLOR, widths=1)
        ]
        self._send([LOSS], steps, values, style)
        self._send([LOGARITHMS, LOSS], steps, _log10(values), style)

    def send_rates(self, rates: Sequence[RatePoint]) -> None:
        """Send the curve of the learning rate."""
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
        """Send the curves of every error, of each set in its colour."""
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
