"""What there is to see of a training: points of its curves, motions, and the worst pairs."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32

from dnet.types import Cloud, Point


@dataclass(frozen=True, slots=True)
class LossPoint:
    """One point of the curve of losses."""

    step: int
    """Batches since the training began."""
    loss: float
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
