"""Everything that shapes a training, the data and the network aside."""

import math
from dataclasses import dataclass, field
from typing import Literal

from dnet.errors import TooFew
from dnet.training.augment import Augmentation

Schedule = Literal["cosine", "step"]
"""`cosine`: down to zero at the end; `step`: divided by 10 every 50 epochs, as in the paper."""

PairKind = Literal["all", "any", "rest"]
"""`all`: all ordered pairs of the clouds of a group, each encoded once; `any`: any two frames of
an episode; `rest`: from the rest shape to the others, as in the paper."""

Precision = Literal["float32", "bfloat16"]

WARM_UP, WARM_UP_SHARE = 100, 0.05
"""Steps in which the learning rate comes up, or this share of the training if that is shorter:
Adam's first estimates are of few gradients."""


@dataclass(frozen=True, slots=True)
class TrainingSettings:
    """How to train."""

    epochs: int | float = 100
    """How often everything is learned from; the last time perhaps in part."""
    learning_rate: float = 2e-3
    """Of Adam, at its highest."""
    schedule: Schedule = "cosine"
    seed: int = 0
    """Of the first weights, the order of batches and the augmentation."""
    pairs: PairKind = "all"
    groups: int = 2
    """Groups in a batch, over all processes."""
    frames: int = 8
    """Frames in a group, all pairs of which are trained on. Of single pairs, a batch has so many
    that it encodes as many clouds."""
    rest_share: float = 0.25
    """Share of the groups that the rest shape joins: it is one frame of very many, and where
    every servo run begins."""
    augmentation: Augmentation | None = field(default_factory=Augmentation)
    """How groups are placed anew at every turn; None leaves them where they are."""
    gradient_limit: float = 1.0
    """Largest norm of the gradient, of a loss in the network's unit."""
    average: float = 0.999
    """How much of the averaged weights stays at each step; these are what is judged and kept."""
    precision: Precision = "float32"
    """Of activations; `bfloat16` on GPUs that have it."""

    def __post_init__(self) -> None:
        for what, got, least in (
            ("number of epochs", self.epochs, 1e-9),
            ("number of groups in a batch", self.groups, 1),
            ("number of frames in a group", self.frames, 2),
        ):
            if got < least:
                raise TooFew(what, got, least)

    @property
    def batch(self) -> int:
        """What a batch has: groups, or single pairs."""
        return self.groups if self.pairs == "all" else max(1, self.groups * self.frames // 2)

    def rate(self, progress: float, *, step: int) -> float:
        """Return the learning rate.

        Args:
            progress: How much of the training is done, from 0 to 1.
            step: How many steps have been made.
        """
        warm = min(1.0, max((step + 1) / WARM_UP, progress / WARM_UP_SHARE))
        if self.schedule == "step":
            return warm * self.learning_rate * 0.1 ** (int(progress * self.epochs + 1e-9) // 50)
        return warm * self.learning_rate * (1 + math.cos(math.pi * progress)) / 2

    def kept(self, step: int) -> float:
        """Return how much of the averaged weights stays at a step; less while there are few."""
        return min(self.average, (1 + step) / (10 + step))
