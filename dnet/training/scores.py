"""How far predicted motions are from true ones, next to predicting no motion at all."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float, Float32
from torch import Tensor

from dnet.datasets.pairs import AnyTwo
from dnet.errors import TooFew
from dnet.nets.deformernet import DeformerNet
from dnet.nets.hu import HuNet
from dnet.nets.keypoints import KeypointNet
from dnet.training.frames import Frames, Rows

# Encoded and compared at once: few enough that judging takes no more memory than learning.
_CLOUDS, _PAIRS = 32, 65536

Watch = Callable[[Rows, Rows, Float[Tensor, "p 3"], Float[Tensor, "p 3"]], None]
"""Told of pairs as they are judged: rows of the current and the goal frames, the predicted and
the true motions in metres."""


@dataclass(frozen=True, slots=True)
class Scores:
    """Errors over a set of pairs."""

    pairs: int
    mse_mm2: float
    """Squared error, mean over pairs and over x, y, z, in square millimetres."""
    sum_mm2: float
    """Squared error, mean over pairs and summed over x, y, z: three times `mse_mm2`."""
    mean_mm: float
    """Mean Euclidean error in millimetres."""
    r2: float | None
    """Share of the variance of the motions that is explained; None if they do not vary."""
    zero_mse_mm2: float
    """`mse_mm2` of predicting no motion."""
    zero_mean_mm: float
    """`mean_mm` of predicting no motion: the mean length of a motion."""
    mean_mse_mm2: float
    """`mse_mm2` of predicting the mean motion of these pairs."""


@dataclass(frozen=True, slots=True)
class Errors:
    """Scores of a network on a set of frames."""

    any_pair: Scores | None
    """Over all ordered pairs of frames of one episode: what a servo loop meets; None of a network
    that looks at the rest shape alone."""
    from_rest: Scores | None
    """From the rest shape to every other: its first step; None without a rest frame."""

    @property
    def main(self) -> Scores:
        """The scores that networks are chosen by."""
        scores = self.any_pair or self.from_rest
        if scores is None:
            raise TooFew("number of pairs that a network is judged by", 0, 1)
        return scores


class Tally:
    """Adds up what scores are made of, pair by pair, in double precision."""

    def __init__(self) -> None:
        self.pairs = 0
        self._squares = self._lengths = self._true_squares = self._true_lengths = 0.0
        self._true = torch.zeros(3, dtype=torch.float64)

    def add(self, predicted: Float[Tensor, "p 3"], true: Float[Tensor, "p 3"]) -> None:
        """Count some pairs, both motions in metres."""
        predicted_mm, true_mm = predicted.double() * 1000, true.double() * 1000
        error = predicted_mm - true_mm
        self.pairs += len(true)
        self._squares += error.square().sum().item()
        self._lengths += error.norm(dim=1).sum().item()
        self._true += true_mm.sum(dim=0)
        self._true_squares += true_mm.square().sum().item()
        self._true_lengths += true_mm.norm(dim=1).sum().item()

    def scores(self) -> Scores:
        """Return the errors over all that were counted; there must be some."""
        pairs = self.pairs
        variance = self._true_squares - self._true.square().sum().item() / pairs
        return Scores(
            pairs=pairs,
            mse_mm2=self._squares / pairs / 3,
            sum_mm2=self._squares / pairs,
            mean_mm=self._lengths / pairs,
            r2=1 - self._squares / variance if variance > 1e-12 * self._true_squares else None,
            zero_mse_mm2=self._true_squares / pairs / 3,
            zero_mean_mm=self._true_lengths / pairs,
            mean_mse_mm2=variance / pairs / 3,
        )


def score(predicted: Float[Tensor, "p 3"], true: Float[Tensor, "p 3"]) -> Scores:
    """Return the errors of `predicted` motions, both in metres."""
    tally = Tally()
    tally.add(predicted, true)
    return tally.scores()


def errors_of(
    model: DeformerNet | HuNet | KeypointNet,
    frames: Frames,
    *,
    watch: Watch | None = None,
    on_clouds: Callable[[int], None] = lambda _: None,
) -> Errors | None:
    """Return the errors of `model` on all pairs of `frames`, None if there is no pair.

    One episode after another, each cloud with its usual centroids, so that the memory it takes
    does not grow with the dataset. Of a keypoint network, the motion is how far it carries the
    manipulation point of the current frame: something that it was not taught.

    Args:
        model: On any device.
        frames: To judge it by.
        watch: Told of all pairs.
        on_clouds: Called with how many clouds are done, as they are.
    """
    was_training = model.training
    model.eval()
    every, rest = Tally(), Tally()
    try:
        with torch.inference_mode():
            for file in np.unique(frames.table.file).tolist():
                rows = np.flatnonzero(frames.table.file == file)
                features = _encode(model, frames, rows)
                _judge(model, frames, rows, features=features, tallies=(every, rest), watch=watch)
                on_clouds(len(rows))
    finally:
        model.train(was_training)
    if not every.pairs:
        return None
    return Errors(every.scores(), rest.scores() if rest.pairs else None)


def no_motion(frames: Frames) -> Scores:
    """Return the scores of predicting no motion for every pair of `frames`."""
    tally = Tally()
    for file in np.unique(frames.table.file).tolist():
        rows = np.flatnonzero(frames.table.file == file)
        pairs = AnyTwo((len(rows),))
        current, goal = pairs.rows(np.arange(len(pairs)))
        true = torch.from_numpy(frames.motions(rows[current], rows[goal]))
        tally.add(true * 0, true)
    return tally.scores()


def _encode(
    model: DeformerNet | HuNet | KeypointNet, frames: Frames, rows: Rows
) -> Float[Tensor, "n c"]:
    device = next(model.parameters()).device
    batches = np.split(rows, range(_CLOUDS, len(rows), _CLOUDS))
    return torch.cat([model.encode(frames.prepared(batch).to(device)) for batch in batches])


def _judge(
    model: DeformerNet | HuNet | KeypointNet,
    frames: Frames,
    rows: Rows,
    *,
    features: Float[Tensor, "n c"],
    tallies: tuple[Tally, Tally],
    watch: Watch | None,
) -> None:
    """Count all pairs of the frames of one episode."""
    every, rest = tallies
    pairs = AnyTwo((len(rows),))
    for start in range(0, len(pairs), _PAIRS):
        numbers = np.arange(start, min(start + _PAIRS, len(pairs)))
        current, goal = pairs.rows(numbers)
        predicted = _motions(model, features[current], features[goal], frames.points(rows[current]))
        true = torch.from_numpy(frames.motions(rows[current], rows[goal]))
        every.add(predicted, true)
        begun = frames.table.rest[rows[current]]
        rest.add(predicted[begun], true[begun])
        if watch is not None:
            watch(rows[current], rows[goal], predicted, true)


def _motions(
    model: DeformerNet | HuNet | KeypointNet,
    start: Float[Tensor, "p c"],
    end: Float[Tensor, "p c"],
    grasps: Float32[np.ndarray, "p 3"],
) -> Float[Tensor, "p 3"]:
    if isinstance(model, DeformerNet | HuNet):
        return model.motion(start, end).float().cpu()
    unit = model.config.coordinate_unit
    points = torch.from_numpy(grasps / np.float32(unit)).to(start.device)[:, None]
    return unit * model.displacements(points, start, end)[:, 0].float().cpu()
