"""Pairs worth looking at, kept while a network is judged: some of all, and the worst."""

import heapq
from dataclasses import dataclass, field

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from dnet.training.division import pairs_of
from dnet.training.frames import Frames, Rows
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
    grasp: Point
    """The manipulation point of the current frame, in metres."""
    true: Point
    """The motion of the grasp, in metres."""
    predicted: Point
    error_mm: float


@dataclass
class Showcase:
    """Watches a network being judged on a set of frames."""

    frames: Frames
    _seen: int = 0
    _predicted: list[Float[Tensor, "_ 3"]] = field(default_factory=list)
    _true: list[Float[Tensor, "_ 3"]] = field(default_factory=list)
    _worst: dict[int, tuple[float, int, int, Float[Tensor, " 3"]]] = field(default_factory=dict)
    """Of each episode: error in millimetres, rows of current and goal, predicted motion."""

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
        if error > self._worst.get(file, (0.0,))[0]:
            rows = int(current[worst]), int(goal[worst])
            self._worst[file] = (error, *rows, predicted[worst].clone())

    @property
    def motions(self) -> tuple[Float[Tensor, "_ 3"], Float[Tensor, "_ 3"]]:
        """Predicted and true motions of the pairs that were kept, in metres."""
        none = torch.zeros(0, 3)
        return torch.cat([none, *self._predicted]), torch.cat([none, *self._true])

    def worst(self) -> list[Pair]:
        """Return the worst pairs, each of another episode, the worst first."""
        table = self.frames.table
        pairs = []
        for error, current, goal, predicted in heapq.nlargest(
            WORST, self._worst.values(), key=lambda kept: kept[0]
        ):
            name = table.episodes[int(table.file[current])]
            pairs.append(
                Pair(
                    f"{name} {table.frame[current]} → {table.frame[goal]}",
                    self.frames.clouds[current],
                    self.frames.clouds[goal],
                    table.grasps[current],
                    table.grasps[goal] - table.grasps[current],
                    predicted.numpy().astype(np.float64),
                    error,
                )
            )
        return pairs
