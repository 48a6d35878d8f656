"""Batches of all pairs: each cloud is encoded once and meets every other of its episode."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Int64
from torch import Tensor

Rows = Int64[np.ndarray, "_"]


@dataclass(frozen=True, slots=True)
class Batch:
    """Frames to encode, and which of them form pairs."""

    frames: Int64[Tensor, " n"]
    """Rows of the frames among all frames of the training set."""
    groups: Int64[Tensor, " n"]
    """Which group each frame belongs to, from 0; a group is of one episode."""
    current: Int64[Tensor, " p"]
    """Places in `frames` of the current frame of each pair."""
    goal: Int64[Tensor, " p"]
    """Places in `frames` of the goal frame of each pair."""

    @property
    def group_count(self) -> int:
        """How many groups there are."""
        return int(self.groups[-1]) + 1


def all_pairs(
    lengths: Sequence[int], *, seed: int, epoch: int, groups: int = 1, frames: int = 5
) -> list[Batch]:
    """Return the batches of one epoch, a pure function of the arguments.

    Every frame is encoded once an epoch. The frames of an episode are shuffled and dealt into
    groups of about `frames`; `groups` groups, of any episodes, form a batch; all ordered pairs
    within a group are trained on. G groups of m frames are G m (m - 1) pairs for the price of
    G m encodings.

    Args:
        lengths: Frames of each episode, at least two each.
        seed: Of the whole training.
        epoch: Which order of that seed.
        groups: How many groups form a batch.
        frames: The least frames of a group, except in an episode with fewer; at least two.
    """
    rng = np.random.default_rng((seed, epoch))
    dealt: list[Rows] = []
    start = 0
    for length in lengths:
        order = start + rng.permutation(length)
        dealt += np.array_split(order, max(1, length // frames))
        start += length
    chosen = [dealt[index] for index in rng.permutation(len(dealt))]
    return [_batch(chosen[first : first + groups]) for first in range(0, len(chosen), groups)]


def ordered_pairs(count: int) -> tuple[Rows, Rows]:
    """Return the first and the second of all ordered pairs of `count` different things."""
    current, goal = np.nonzero(~np.eye(count, dtype=bool))
    return current, goal


def _batch(groups: Sequence[Rows]) -> Batch:
    current, goal = [], []
    start = 0
    for group in groups:
        one, other = ordered_pairs(len(group))
        current.append(start + one)
        goal.append(start + other)
        start += len(group)
    numbers = np.repeat(np.arange(len(groups)), [len(group) for group in groups])
    return Batch(
        *(
            torch.from_numpy(np.asarray(rows, dtype=np.int64))
            for rows in (
                np.concatenate(groups),
                numbers,
                np.concatenate(current),
                np.concatenate(goal),
            )
        )
    )
