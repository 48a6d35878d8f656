"""How far predicted motions are from true ones, next to predicting no motion at all."""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Float32, Int64
from torch import Tensor

from dnet.nets.deformernet import DeformerNet
from dnet.nets.neighbourhoods import stack
from dnet.training.frames import Frames

# Encoded and compared at once: few enough that judging takes no more memory than learning.
_CLOUDS, _PAIRS = 32, 65536


@dataclass(frozen=True, slots=True)
class Scores:
    """Errors over a set of pairs."""

    pairs: int
    mse_mm2: float
    """Squared error, mean over pairs and over x, y, z, in square millimetres."""
    mean_mm: float
    """Mean Euclidean error in millimetres."""
    r2: float | None
    """Share of the variance of the motions that is explained; None if they do not vary."""
    zero_mse_mm2: float
    """`mse_mm2` of predicting no motion."""
    zero_mean_mm: float
    """`mean_mm` of predicting no motion: the mean length of a motion."""


@dataclass(frozen=True, slots=True)
class Errors:
    """Scores of a network on a set of frames."""

    any_pair: Scores
    """Over all ordered pairs of frames of one episode: what a servo loop meets."""
    from_rest: Scores | None
    """From the rest shape to every other: its first step; None without a rest frame."""


def score(predicted: Float[Tensor, "p 3"], true: Float[Tensor, "p 3"]) -> Scores:
    """Return the errors of `predicted` motions, both in metres."""
    predicted_mm, true_mm = predicted.double() * 1000, true.double() * 1000
    error = predicted_mm - true_mm
    variance = (true_mm - true_mm.mean(dim=0)).square().sum().item()
    return Scores(
        pairs=len(true),
        mse_mm2=float(error.square().mean()),
        mean_mm=float(error.norm(dim=1).mean()),
        r2=1 - error.square().sum().item() / variance if variance else None,
        zero_mse_mm2=float(true_mm.square().mean()),
        zero_mean_mm=float(true_mm.norm(dim=1).mean()),
    )


def errors_of(model: DeformerNet, frames: Frames) -> Errors:
    """Return the errors of `model` on `frames`, each cloud with its usual centroids."""
    was_training = model.training
    model.eval()
    try:
        with torch.no_grad():
            current, goal = frames.all_pairs()
            predicted = _predict(model, frames, current, goal)
    finally:
        model.train(was_training)
    true = frames.motions(current, goal)
    from_rest = frames.rest[current]
    return Errors(
        score(predicted, true),
        score(predicted[from_rest], true[from_rest]) if from_rest.any() else None,
    )


def _predict(
    model: DeformerNet, frames: Frames, current: Int64[Tensor, " p"], goal: Int64[Tensor, " p"]
) -> Float32[Tensor, "p 3"]:
    device = next(model.parameters()).device
    clouds = [choices[0] for choices in frames.clouds]
    batches = (clouds[first : first + _CLOUDS] for first in range(0, len(clouds), _CLOUDS))
    features = torch.cat([model.encode(stack(batch).to(device)) for batch in batches])
    motions = [
        model.motion(features[one], features[other]).cpu()
        for one, other in zip(
            torch.split(current.to(device), _PAIRS),
            torch.split(goal.to(device), _PAIRS),
            strict=True,
        )
    ]
    return torch.cat(motions)
