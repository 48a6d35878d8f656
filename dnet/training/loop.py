"""The training loop: all-pairs batches, Adam, a schedule, and the best network kept."""

import copy
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional

from dnet.errors import TooFew
from dnet.nets.deformernet import DeformerNet, DeformerNetConfig
from dnet.nets.neighbourhoods import stack
from dnet.training.augment import Augmentation, place, turn
from dnet.training.batches import Batch, all_pairs
from dnet.training.frames import Frames
from dnet.training.scores import Errors, errors_of

Schedule = Literal["cosine", "step"]
"""`cosine`: down to zero at the end; `step`: divided by 10 every 50 epochs, as in the paper."""

Weights = dict[str, Tensor]


@dataclass(frozen=True, slots=True)
class TrainingSettings:
    """Everything that shapes a training, the data and the network aside."""

    epochs: int = 100
    learning_rate: float = 1e-3
    """Of Adam, at the beginning."""
    schedule: Schedule = "cosine"
    seed: int = 0
    """Of the first weights, the order of batches and the augmentation."""
    groups: int = 1
    """Groups in a batch."""
    frames: int = 5
    """Frames in a group, all pairs of which are trained on."""
    augmentation: Augmentation | None = field(default_factory=Augmentation)
    """How groups are placed anew at every turn; None leaves them where they are."""
    gradient_limit: float = 1.0
    """Largest norm of the gradient, of a loss in the network's unit."""

    def __post_init__(self) -> None:
        for what, got, least in (
            ("number of epochs", self.epochs, 1),
            ("number of groups in a batch", self.groups, 1),
            ("number of frames in a group", self.frames, 2),
        ):
            if got < least:
                raise TooFew(what, got, least)


@dataclass(frozen=True, slots=True)
class StepDone:
    """One batch has been learned from."""

    epoch: int
    """From 1."""
    step: int
    """From 1, within the epoch."""
    steps: int
    """How many the epoch has."""
    loss_mm2: float
    """Mean squared error of the batch, before the update."""
    progress: float
    """Share of the whole training that is done, from 0 to 1."""


@dataclass(frozen=True, slots=True)
class EpochDone:
    """All frames have been seen once more."""

    epoch: int
    """From 1."""
    loss_mm2: float
    """Mean over the epoch's batches; they come augmented and from weights in motion."""
    validation: Errors
    best: bool
    """Whether no epoch before had a smaller validation error over any pair."""
    learning_rate: float
    seconds: float
    """Since the training began."""
    progress: float
    """Share of the whole training that is done, from 0 to 1."""


@dataclass(frozen=True, slots=True)
class Result:
    """What a training leaves."""

    best: Weights
    """Weights of the epoch with the smallest validation error."""
    last: Weights
    history: tuple[EpochDone, ...]
    interrupted: bool
    """Whether someone stopped it."""


def new_network(config: DeformerNetConfig, *, seed: int) -> DeformerNet:
    """Return an untrained network whose first weights are a function of `seed`."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return DeformerNet(config)


def learning_rate_at(settings: TrainingSettings, progress: float) -> float:
    """Return the learning rate when `progress` of the training is done, from 0 to 1."""
    if settings.schedule == "step":
        return settings.learning_rate * 0.1 ** (int(progress * settings.epochs + 1e-9) // 50)
    return settings.learning_rate * (1 + math.cos(math.pi * progress)) / 2


def _ignore(event: StepDone | EpochDone) -> None:
    del event


def fit(
    model: DeformerNet,
    training: Frames,
    *,
    validation: Frames,
    settings: TrainingSettings,
    on_event: Callable[[StepDone | EpochDone], None] = _ignore,
    seconds: float = math.inf,
) -> Result:
    """Train `model` in place and return the best and the last of its weights.

    On one machine's CPU, the same arguments give the same weights, as long as `seconds` is left
    alone. A KeyboardInterrupt after the first epoch ends the training; what the whole epochs
    up to there have left is returned.

    Args:
        model: On any device.
        training: What to learn from.
        validation: What the best epoch is chosen by.
        settings: How.
        on_event: Told of every batch and every epoch, at whose end the weights are in `model`.
        seconds: Time that training may take; the schedule then follows the clock wherever that
            is ahead of the epochs, so that the learning rate still comes down.
    """
    optimizer = torch.optim.Adam(model.parameters(), lr=settings.learning_rate, fused=True)
    clock = _Clock(settings.epochs, seconds, time.monotonic())
    history: list[EpochDone] = []
    best = last = _weights(model)
    interrupted = False
    try:
        while not history or history[-1].progress < 1:
            epoch = len(history)
            loss = _epoch(
                model,
                optimizer,
                training=training,
                settings=settings,
                clock=clock,
                epoch=epoch,
                on_event=on_event,
            )
            errors = errors_of(model, validation)
            least = min((done.validation.any_pair.mse_mm2 for done in history), default=math.inf)
            done = EpochDone(
                epoch=epoch + 1,
                loss_mm2=loss,
                validation=errors,
                best=errors.any_pair.mse_mm2 < least or not history,
                learning_rate=optimizer.param_groups[0]["lr"],
                seconds=time.monotonic() - clock.began,
                progress=clock.progress(epoch + 1),
            )
            history.append(done)
            last = _weights(model)
            best = last if done.best else best
            on_event(done)
    except KeyboardInterrupt:
        if not history:
            raise
        interrupted = True
    return Result(best, last, tuple(history), interrupted)


@dataclass(frozen=True, slots=True)
class _Clock:
    """How much of a training is done, by its epochs or by its time."""

    epochs: int
    seconds: float
    began: float

    def progress(self, epochs_done: int | float) -> float:
        elapsed = time.monotonic() - self.began
        return min(1.0, max(epochs_done / self.epochs, elapsed / self.seconds))


def _epoch(
    model: DeformerNet,
    optimizer: torch.optim.Optimizer,
    *,
    training: Frames,
    settings: TrainingSettings,
    clock: _Clock,
    epoch: int,
    on_event: Callable[[StepDone | EpochDone], None],
) -> float:
    """Learn from every batch once and return the mean loss; stop early when time is up."""
    model.train()
    batches = all_pairs(
        training.lengths,
        seed=settings.seed,
        epoch=epoch,
        groups=settings.groups,
        frames=settings.frames,
    )
    # Apart from the order of batches, which is drawn from (seed, epoch).
    rng = np.random.default_rng((settings.seed, epoch, 1))
    unit = model.config.motion_unit
    losses: list[float] = []
    for step, batch in enumerate(batches):
        progress = clock.progress(epoch + step / len(batches))
        if progress >= 1 and losses:
            break
        for group in optimizer.param_groups:
            group["lr"] = learning_rate_at(settings, progress)
        optimizer.zero_grad(set_to_none=True)
        predicted, true = _motions(
            model, training, batch=batch, augmentation=settings.augmentation, rng=rng
        )
        # In the network's unit, errors and so gradients are near 1.
        loss = functional.mse_loss(predicted / unit, true / unit)
        torch.autograd.backward(loss)
        torch.nn.utils.clip_grad_norm_(model.parameters(), settings.gradient_limit)
        optimizer.step()
        losses.append(loss.item() * (unit * 1000) ** 2)
        on_event(StepDone(epoch + 1, step + 1, len(batches), losses[-1], progress))
    return float(np.mean(losses))


def _motions(
    model: DeformerNet,
    frames: Frames,
    *,
    batch: Batch,
    augmentation: Augmentation | None,
    rng: np.random.Generator,
) -> tuple[Tensor, Tensor]:
    """Return the predicted and the true motions of a batch, in metres."""
    device = next(model.parameters()).device
    groups, current, goal = batch.groups, batch.current, batch.goal
    choices = [frames.clouds[row] for row in batch.frames.tolist()]
    clouds = stack([of[rng.integers(len(of))] for of in choices])
    true = frames.motions(batch.frames[current], batch.frames[goal])
    if augmentation is not None:
        placement = augmentation.draw(rng, batch.group_count)
        unit = model.config.coordinate_unit
        clouds = place(clouds, placement, groups=groups, coordinate_unit=unit)
        true = turn(true, placement, groups=groups[current])
    features = model.encode(clouds.to(device))
    predicted = model.motion(features[current.to(device)], features[goal.to(device)])
    return predicted, true.to(device)


def _weights(model: DeformerNet) -> Weights:
    return copy.deepcopy(model.state_dict())
