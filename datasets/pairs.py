"""What a sample is: which frames of one episode are the current shape and the goal."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Bool, Int64

from dnet.datasets.frame_table import FrameTable
from dnet.datasets.permutation import Numbers, Permutation
from dnet.errors import NotAFraction, TooFew

Rows = Int64[np.ndarray, "_"]
"""Rows of a table of frames."""

_P = TypeVar("_P", "AnyTwo", "FromRest")


@runtime_checkable
class Pairs(Protocol):
    """Samples by number, in an order that depends on the epoch or not."""

    def __len__(self) -> int:
        """Return how many samples an epoch has."""
        ...

    def rows(self, numbers: Numbers, *, epoch: int) -> tuple[Rows, Rows]:
        """Return the frames that are current and those that are the goal."""
        ...


@dataclass(frozen=True)
class AnyTwo:
    """All ordered pairs of two frames of one episode: n (n - 1) of n frames.

    Args:
        lengths: Frames of each episode; those of one are together.
    """

    lengths: Sequence[int]
    _starts: Rows = field(init=False, repr=False)
    _ends: Rows = field(init=False, repr=False)
    """Numbers of the pairs at which each episode begins, and the end."""

    def __post_init__(self) -> None:
        """Count the pairs."""
        lengths = np.asarray(self.lengths, dtype=np.int64)
        object.__setattr__(self, "_starts", np.cumsum(lengths) - lengths)
        object.__setattr__(self, "_ends", np.cumsum(lengths * (lengths - 1)))

    def __len__(self) -> int:
        return int(self._ends[-1]) if len(self._ends) else 0

    def rows(self, numbers: Numbers, *, epoch: int = 0) -> tuple[Rows, Rows]:  # noqa: ARG002
        """Return the frames of pairs, which are the same in every epoch."""
        episodes = np.searchsorted(self._ends, numbers, side="right")
        lengths = np.asarray(self.lengths, dtype=np.int64)[episodes]
        within = numbers - (self._ends[episodes] - lengths * (lengths - 1))
        current, other = np.divmod(within, np.maximum(lengths - 1, 1))
        # The goal is one of the others: it steps over the current frame.
        goal = other + (other >= current)
        starts = self._starts[episodes]
        return starts + current, starts + goal


@dataclass(frozen=True)
class FromRest:
    """The rest frame of an episode and each of its shapes, as the paper trains.

    Args:
        lengths: Frames of each episode; those of one are together.
        rest: Of each frame, whether it shows the rest shape. The first such frame of an episode
            counts; an episode without one has no samples.
    """

    lengths: Sequence[int]
    rest: Bool[np.ndarray, " n"]
    _current: Rows = field(init=False, repr=False)
    _goal: Rows = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Find the rest frame of each episode."""
        rests = np.flatnonzero(self.rest)
        episode = np.repeat(np.arange(len(self.lengths)), self.lengths)
        first = np.full(len(self.lengths), -1)
        first[episode[rests][::-1]] = rests[::-1]
        goal = np.flatnonzero(~self.rest)
        goal = goal[first[episode[goal]] >= 0]
        object.__setattr__(self, "_current", first[episode[goal]])
        object.__setattr__(self, "_goal", goal)

    def __len__(self) -> int:
        return len(self._goal)

    def rows(self, numbers: Numbers, *, epoch: int = 0) -> tuple[Rows, Rows]:  # noqa: ARG002
        """Return the frames of pairs, which are the same in every epoch."""
        return self._current[numbers], self._goal[numbers]


@dataclass(frozen=True)
class Mixed:
    """All samples of one kind, and so many of another that they have a stated share.

    Which of the other kind come in changes with the epoch, without repeats until all were there
    within one epoch.

    Args:
        all_of: Every sample of these comes once an epoch.
        some_of: Of these come as many as it takes, at most all.
        share: How much of an epoch is `some_of`, from 0 up to, not including, 1.
        seed: Of the choice.

    Raises:
        NotAFraction: If the share is no such number.
    """

    all_of: Pairs
    some_of: Pairs
    share: float
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse a share that cannot be."""
        if not 0 <= self.share < 1:
            raise NotAFraction("share of the second kind of samples", self.share)

    @property
    def chosen(self) -> int:
        """How many of the second kind an epoch has."""
        wanted = round(len(self.all_of) * self.share / (1 - self.share))
        return min(wanted, len(self.some_of))

    def __len__(self) -> int:
        return len(self.all_of) + self.chosen

    def rows(self, numbers: Numbers, *, epoch: int) -> tuple[Rows, Rows]:
        """Return the frames of samples."""
        first = len(self.all_of)
        order = Permutation(len(self.some_of), seed=(self.seed, epoch, 1))
        current, goal = np.empty_like(numbers), np.empty_like(numbers)
        own = numbers < first
        current[own], goal[own] = self.all_of.rows(numbers[own], epoch=epoch)
        others = order.at(numbers[~own] - first)
        current[~own], goal[~own] = self.some_of.rows(others, epoch=epoch)
        return current, goal


def any_two(table: FrameTable) -> AnyTwo:
    """Return all ordered pairs of frames of one episode.

    Raises:
        TooFew: If no episode has two frames.
    """
    return _some(AnyTwo(tuple(table.lengths.tolist())), table, "two settled frames")


def from_rest(table: FrameTable) -> FromRest:
    """Return the pairs of a rest frame and a shape of its episode.

    Raises:
        TooFew: If no episode has both.
    """
    lengths = tuple(table.lengths.tolist())
    return _some(FromRest(lengths, table.rest), table, "a rest frame and a shape")


def mixed(table: FrameTable, *, share: float, seed: int = 0) -> Mixed:
    """Return every pair from rest, and any two frames with a share of `share`.

    Raises:
        TooFew: If no episode has a rest frame and a shape.
        NotAFraction: If the share is not from 0 up to, not including, 1.
    """
    return Mixed(from_rest(table), any_two(table), share, seed)


def _some(pairs: _P, table: FrameTable, what: str) -> _P:
    if not len(pairs):
        raise TooFew(f"number of episodes in {table.root} with {what}", 0, 1)
    return pairs
