"""Groups for training on all pairs: some clouds of one episode, each to be encoded once."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float32, Int64
from torch import Tensor
from torch.utils.data import Dataset

from dnet.datasets.batch_order import Drawn
from dnet.datasets.clouds import Clouds
from dnet.datasets.pairs import Rows
from dnet.datasets.permutation import Permutation
from dnet.errors import NotAFraction, TooFew


@dataclass(frozen=True, slots=True)
class GroupBatch:
    """Clouds of some groups, and all ordered pairs within each group.

    G groups of m clouds are G m (m - 1) pairs for the price of G m encodings.
    """

    clouds: Float32[Tensor, "k n 3"]
    grasps: Float32[Tensor, "k 3"]
    """The manipulation point of each cloud, in metres."""
    groups: Int64[Tensor, " k"]
    """Which group of the batch each cloud is in, from 0."""
    current: Int64[Tensor, " p"]
    """Of each pair: which of the clouds is the current one."""
    goal: Int64[Tensor, " p"]
    """Of each pair: which of the clouds is the goal."""
    rows: Int64[Tensor, " k"]
    """Which frames of the table the clouds are."""

    def __len__(self) -> int:
        return len(self.clouds)

    def pin_memory(self) -> "GroupBatch":
        """Return the batch in memory from which a GPU reads fastest."""
        parts = (self.clouds, self.grasps, self.groups, self.current, self.goal, self.rows)
        return GroupBatch(*(part.pin_memory() for part in parts))


class Chosen(NamedTuple):
    """Which frames a batch of groups has."""

    rows: Rows
    groups: Rows
    """Which group of the batch each is in, from 0."""
    current: Rows
    """Of each pair: which of the frames is the current one."""
    goal: Rows
    """Of each pair: which of the frames is the goal."""


@dataclass(frozen=True)
class Dealt:
    """The frames of each episode, shuffled anew for every epoch and dealt into groups."""

    lengths: tuple[int, ...]
    """Frames of each episode; one with fewer than two has no group."""
    size: int
    """The least frames of a group, except in an episode with fewer; at least two."""
    seed: int = 0
    _starts: Rows = field(init=False, repr=False)
    _ends: Rows = field(init=False, repr=False)
    """Number of the group after the last of each episode."""

    def __post_init__(self) -> None:
        """Count the groups.

        Raises:
            TooFew: If groups are to have fewer than two frames, or there is none.
        """
        if self.size < 2:
            raise TooFew("number of frames in a group", self.size, 2)
        lengths = np.asarray(self.lengths, dtype=np.int64)
        counts = np.where(lengths < 2, 0, np.maximum(1, lengths // self.size))
        object.__setattr__(self, "_starts", np.cumsum(lengths) - lengths)
        object.__setattr__(self, "_ends", np.cumsum(counts))
        if not len(self):
            raise TooFew("number of episodes with two settled frames", 0, 1)

    def __len__(self) -> int:
        return int(self._ends[-1]) if len(self._ends) else 0

    def rows(self, number: int, *, epoch: int) -> Rows:
        """Return the frames of a group in an epoch."""
        episode = int(np.searchsorted(self._ends, number, side="right"))
        length, before = self.lengths[episode], int(self._ends[episode - 1]) if episode else 0
        count, place = int(self._ends[episode]) - before, number - before
        # As evenly as it goes, the first groups one frame longer: as numpy splits an array.
        start, stop = (
            one * (length // count) + min(one, length % count) for one in (place, place + 1)
        )
        order = Permutation(length, seed=(self.seed, epoch, episode))
        return self._starts[episode] + order.part(start, stop)


class Groups(Dataset[GroupBatch]):
    """The groups of a dataset, by batches that a `BatchOrder` draws.

    Args:
        clouds: Of the frames of a table.
        size: The least clouds of a group, except in an episode with fewer; at least two.
        seed: Of who meets whom.
        rest_share: How many groups the rest shape of their episode joins, if it is not dealt to
            them, from 0 to 1. It is one frame of very many, and where every servo run begins.

    Raises:
        TooFew: If groups are to have fewer than two frames, or there is none.
        NotAFraction: If `rest_share` is not between 0 and 1.
    """

    def __init__(
        self, clouds: Clouds, *, size: int = 5, seed: int = 0, rest_share: float = 0.0
    ) -> None:
        if not 0 <= rest_share <= 1:
            raise NotAFraction("share of the groups that the rest shape joins", rest_share)
        self.clouds = clouds
        self.rest_share = rest_share
        self.dealt = Dealt(tuple(clouds.table.lengths.tolist()), size, seed)

    def __len__(self) -> int:
        return len(self.dealt)

    def choose(self, drawn: Drawn) -> Chosen:
        """Return which frames a batch of groups has, and its pairs."""
        groups = [self._rows(number, epoch=drawn.epoch) for number in drawn.numbers.tolist()]
        sizes = np.array([len(group) for group in groups])
        rows, numbers = np.concatenate(groups), np.repeat(np.arange(len(groups)), sizes)
        # All pairs of the batch, those within one group.
        same = numbers[:, None] == numbers
        current, goal = np.nonzero(same & ~np.eye(len(rows), dtype=bool))
        return Chosen(rows, numbers, current, goal)

    def __getitem__(self, drawn: Drawn) -> GroupBatch:
        """Return a batch of groups."""
        rows, numbers, current, goal = self.choose(drawn)
        grasps = self.clouds.table.grasps[rows].astype(np.float32)
        arrays = (self.clouds.stack(rows), grasps, numbers, current, goal, rows)
        return GroupBatch(*(torch.from_numpy(array) for array in arrays))

    @property
    def fingerprint(self) -> str:
        """What changes when one of the files does, or other frames are taken."""
        dealt = f"{self.dealt.size}-{self.dealt.seed}-{self.rest_share:g}"
        return f"{self.clouds.table.fingerprint}-{dealt}"

    def _rows(self, number: int, *, epoch: int) -> Rows:
        """Return the frames of a group, with the rest shape in front if it joins."""
        rows = self.dealt.rows(number, epoch=epoch)
        chance = np.random.default_rng((self.dealt.seed, epoch, number)).random()
        rest = self._rests[self.clouds.table.file[rows[0]]]
        if chance >= self.rest_share or rest < 0 or rest in rows:
            return rows
        return np.concatenate([[rest], rows])

    @cached_property
    def _rests(self) -> Rows:
        """The row of the rest shape of each file, -1 if it has none."""
        table = self.clouds.table
        rests = np.flatnonzero(table.rest)
        found = np.full(len(table.names), -1)
        found[table.file[rests][::-1]] = rests[::-1]
        return found
