"""A training under way: everything that its next step depends on, to be put down and taken up."""

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any, cast

import torch
from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel

from dnet.datasets.stream import Stream
from dnet.training.examples import Examples
from dnet.training.objectives import Network, Objective
from dnet.training.parallel import Process
from dnet.training.progress import StepDone
from dnet.training.settings import TrainingSettings

Weights = dict[str, Tensor]

CURVE = 20
"""Points of an epoch in the curve of its losses."""


class Training:
    """Learns batch by batch; its state can be saved after any of them.

    The same arguments give the same weights on one machine's CPU, as long as `seconds` is left
    alone, wherever it was put down in between.

    Args:
        objective: The network to be trained, on any device, and its loss.
        stream: Of batches.
        settings: How.
        process: This one among several.
        seconds: Time that training may take; the schedule then follows the clock wherever that
            is ahead of the epochs, so that the learning rate still comes down.
    """

    def __init__(
        self,
        objective: Objective[Any],
        stream: Stream[Examples],
        settings: TrainingSettings,
        *,
        process: Process | None = None,
        seconds: float = math.inf,
    ) -> None:
        self.objective = objective
        self.model = model = objective.network
        self.settings = settings
        self.process = process or Process()
        self.stream = stream
        self.limit = seconds
        self.steps = 0
        """Batches so far."""
        self.encodings = 0
        """Clouds encoded so far, by all processes."""
        self.waited = 0.0
        """Seconds spent waiting for the loader."""
        self.losses: list[float] = []
        """Of the batches of this epoch, as they are told."""
        self.stopped = False
        """Whether a process was asked to stop: all of them do, after the same batch."""
        self._asked = False
        self._elapsed = 0.0
        self._before = 0.0
        self._began = time.monotonic()
        self._device = next(model.parameters()).device
        self._joined = self.process.joined(objective)
        self._optimizer = torch.optim.Adam(
            model.parameters(), lr=settings.learning_rate, fused=True
        )
        self._average = AveragedModel(model, multi_avg_fn=self._averaged, use_buffers=True)

    @property
    def seconds(self) -> float:
        """How long it has gone on, interruptions left out."""
        return self._before + time.monotonic() - self._began

    @property
    def progress(self) -> float:
        """How much of it is done, from 0 to 1, by its epochs or by its time."""
        return self._progress(self.stream.batch)

    @property
    def rate(self) -> float:
        """The learning rate of the last step."""
        return float(self._optimizer.param_groups[0]["lr"])

    @property
    def average(self) -> Network:
        """The network with averaged weights: the one to judge and to keep."""
        return cast(Network, self._average.module)

    def stop(self) -> None:
        """Ask for an end after the next batch."""
        self._asked = True

    def epoch(self) -> Iterator[StepDone]:
        """Learn from what is left of the epoch, until time is up or someone asks for an end.

        At least one batch is learned from.
        """
        self.model.train()
        number, steps = self.stream.epoch + 1, len(self.stream)
        waiting = time.monotonic()
        for batch in self.stream:
            self.waited += time.monotonic() - waiting
            self.losses.append(self._step(batch))
            yield StepDone(number, len(self.losses), steps, self.losses[-1], self.progress)
            if self.stopped or (self.progress >= 1 and self.stream.batch):
                break
            waiting = time.monotonic()

    def close_epoch(self) -> tuple[float, tuple[float, ...]]:
        """Return the mean loss of the epoch, and that of each of its parts; begin another."""
        losses, self.losses = torch.tensor(self.losses), []
        parts = losses.tensor_split(min(CURVE, len(losses)))
        return losses.mean().item(), tuple(part.mean().item() for part in parts)

    def _step(self, batch: Examples) -> float:
        """Learn from a batch; return its mean loss over all processes, as it is told."""
        batch = batch.to(self._device)
        for group in self._optimizer.param_groups:
            # The stream has counted the batch that is being learned from.
            group["lr"] = self.settings.rate(self._progress(self.stream.batch - 1), step=self.steps)
        self._optimizer.zero_grad(set_to_none=True)
        with self._precision():
            losses = self._joined(
                batch.clouds, batch.current, batch.goal, batch.motions, batch.points
            )
        loss = losses.sum()
        told = (
            len(losses),
            loss.item(),
            len(batch.clouds),
            self.seconds,
            self._asked,
        )
        total = torch.tensor(told, dtype=torch.float64, device=self._device)
        pairs, together, clouds, seconds, asked = self.process.sum(total).tolist()
        # Clocks differ, and learning rates must not.
        self._elapsed, self.stopped = seconds / self.process.world, asked > 0
        # Processes average gradients; what is wanted is the mean over the pairs of all of them.
        torch.autograd.backward(loss * (self.process.world / pairs))
        nn.utils.clip_grad_norm_(self.model.parameters(), self.settings.gradient_limit)
        self._optimizer.step()
        self._average.update_parameters(self.model)
        self.steps += 1
        self.encodings += int(clouds)
        return together / pairs * self.objective.shown

    def _progress(self, batches: int) -> float:
        epochs = (self.stream.epoch + batches / len(self.stream)) / self.settings.epochs
        return max(0.0, min(1.0, max(epochs, self._elapsed / self.limit)))

    def _precision(self) -> AbstractContextManager[Any]:
        low = self.settings.precision == "bfloat16"
        return torch.autocast(self._device.type, torch.bfloat16, enabled=low)

    def _averaged(
        self, averages: Sequence[Tensor], weights: Sequence[Tensor], count: Tensor | int
    ) -> None:
        share = 1 - self.settings.kept(int(count))
        for average, weight in zip(averages, weights, strict=True):
            average.lerp_(weight.to(average.dtype), share)

    def tensors(self) -> Weights:
        """Return all tensors that the next step depends on."""
        found = {f"model.{name}": tensor for name, tensor in self.model.state_dict().items()}
        found |= {f"average.{name}": tensor for name, tensor in self._average.state_dict().items()}
        for number, moments in self._optimizer.state_dict()["state"].items():
            found |= {f"adam.{number}.{name}": tensor for name, tensor in moments.items()}
        return found

    def facts(self) -> dict[str, Any]:
        """Return all else that the next step depends on, as JSON would have it."""
        return {
            "stream": self.stream.state_dict(),
            "steps": self.steps,
            "encodings": self.encodings,
            "losses": self.losses,
            "seconds": self.seconds,
            "waited": self.waited,
        }

    def load(self, tensors: Mapping[str, Tensor], facts: Mapping[str, Any]) -> None:
        """Go on where `tensors` and `facts` were taken.

        Raises:
            OtherStream: If that was with other data, or another order of them.
            RuntimeError: If the tensors are not those of such a training.
        """
        parts: dict[str, Weights] = {"model": {}, "average": {}, "adam": {}}
        for name, tensor in tensors.items():
            part, rest = name.split(".", 1)
            parts[part][rest] = tensor
        self.model.load_state_dict(parts["model"])
        self._average.load_state_dict(parts["average"])
        moments: dict[int, Weights] = {}
        for name, tensor in parts["adam"].items():
            number, moment = name.split(".", 1)
            moments.setdefault(int(number), {})[moment] = tensor
        state = self._optimizer.state_dict()
        self._optimizer.load_state_dict({**state, "state": moments})
        self.stream.load_state_dict(dict(facts["stream"]))
        self.steps, self.encodings = int(facts["steps"]), int(facts["encodings"])
        self.losses = [float(loss) for loss in facts["losses"]]
        self._before, self.waited = float(facts["seconds"]), float(facts["waited"])
        self._elapsed, self._began = self._before, time.monotonic()
