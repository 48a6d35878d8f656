"""Pairs worth looking at, kept while a network is judged: some of all, and the worst."""

import heapq
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from dnet.training.division import pairs_of
from dnet.training.frames import Frames, Rows, Target
from dnet.types import Cloud, Point

SHOWN = 1000
"""Pairs of a set whose motions are kept."""
WORST = 4


@dataclass(frozen=True, slots=True)
class Pair:
    """A pair of frames and what was predicted for it."""

    title: str
    """Which frames of which episode."""
    current: Cloud
    goal: Cloud
    origin: Point
    """Where both answers begin, in metres: the manipulation point of the current frame, or the
    middle of its cloud."""
    true: Point
    """The motion of the grasp, or where to grasp, counted from the origin, in metres."""
    predicted: Point
    error_mm: float


class _Kept(NamedTuple):
    error_mm: float
    current: int
    """Row of the current frame."""
    goal: int
    predicted: Float[Tensor, " 3"]
    true: Float[Tensor, " 3"]


@dataclass
class Showcase:
    """Watches a network being judged on a set of frames."""

    frames: Frames
    target: Target = "motion"
    """What the network predicts: motions of the grasp, or points counted from the middle of the
    current cloud."""
    _seen: int = 0
    _predicted: list[Float[Tensor, "_ 3"]] = field(default_factory=list)
    _true: list[Float[Tensor, "_ 3"]] = field(default_factory=list)
    _worst: dict[int, _Kept] = field(default_factory=dict)
    """Of each episode."""

    def watch(
        self,
        current: Rows,
        goal: Rows,
        predicted: Float[Tensor, "p 3"],
        true: Float[Tensor, "p 3"],
    ) -> None:
        """Keep an even share of these pairs, and the worst one if it is the episode's worst."""
        step = max(1, pairs_of(self.frames.table) // SHOWN)
        chosen = slice(-self._seen % step, None, step)
        self._seen += len(true)
        self._predicted.append(predicted[chosen])
        self._true.append(true[chosen])
        errors = 1000 * (predicted - true).norm(dim=1)
        worst = int(errors.argmax())
        file, error = int(self.frames.table.file[current[worst]]), float(errors[worst])
        if file not in self._worst or error > self._worst[file].error_mm:
            rows = int(current[worst]), int(goal[worst])
            self._worst[file] = _Kept(error, *rows, predicted[worst].clone(), true[worst].clone())

    @property
    def motions(self) -> tuple[Float[Tensor, "_ 3"], Float[Tensor, "_ 3"]]:
        """Predicted and true motions of the pairs that were kept, in metres."""
        none = torch.zeros(0, 3)
        return torch.cat([none, *self._predicted]), torch.cat([none, *self._true])

    def worst(self) -> list[Pair]:
        """Return the worst pairs, each of another episode, the worst first."""
        table = self.frames.table
        pairs = []
        for kept in heapq.nlargest(WORST, self._worst.values(), key=lambda kept: kept.error_mm):
            name = table.episodes[int(table.file[kept.current])]
            cloud = self.frames.clouds[kept.current]
            motion = self.target == "motion"
            pairs.append(
                Pair(
                    f"{name} {table.frame[kept.current]} → {table.frame[kept.goal]}",
                    cloud,
                    self.frames.clouds[kept.goal],
                    table.grasps[kept.current] if motion else cloud.mean(axis=0, dtype=np.float64),
                    kept.true.numpy().astype(np.float64),
                    kept.predicted.numpy().astype(np.float64),
                    kept.error_mm,
                )
            )
        return pairs
