"""What a training tells while it goes on: its steps, its epochs, and how far it is."""

from dataclasses import dataclass

from dnet.training.scores import Errors


@dataclass(frozen=True, slots=True)
class StepDone:
    """One batch has been learned from."""

    epoch: int
    """From 1."""
    step: int
    """From 1, within the epoch."""
    steps: int
    """How many the epoch has."""
    loss: float
    """Mean over the batch, before the update: of squared errors in mm², of heat maps in nats."""
    progress: float
    """Share of the whole training that is done, from 0 to 1."""


@dataclass(frozen=True, slots=True)
class EpochDone:
    """All frames have been seen once more."""

    epoch: int
    """From 1."""
    steps: int
    """Batches since the training began."""
    encodings: int
    """Clouds that were encoded in them."""
    loss: float
    """Mean over the epoch's batches; they come augmented and from weights in motion."""
    losses: tuple[float, ...]
    """The same over each of some equal parts of the epoch, for a curve."""
    unseen_shapes: Errors | None
    """On other shapes of the episodes that are trained on; None if they make no pair."""
    unseen_episodes: Errors
    best: bool
    """Whether no epoch before had a smaller error on the frames that the network is chosen by."""
    learning_rate: float
    seconds: float
    """Of training so far, interruptions left out."""
    waited: float
    """Of these: how long training waited for the loader."""
    progress: float
    """Share of the whole training that is done, from 0 to 1."""
