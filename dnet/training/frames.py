"""The frames that a network learns from, in memory, their neighbourhoods found once."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Bool, Float32, Int64
from torch import Tensor

from dnet.datasets.frame_table import SETTLED
from dnet.errors import BadEpisode, TooFew
from dnet.nets.deformernet import DeformerNetConfig
from dnet.nets.neighbourhoods import GROUPINGS, Neighbourhoods, regroup
from dnet.training.batches import ordered_pairs
from dnet.training.neighbour_tables import FindNeighbourhoods, find_each
from dnet.types import Frame, FrameKind, Place, Point

MOST_SAMPLINGS = 8
"""Choices of centroids of a cloud; more of them cost time and teach little more."""


@runtime_checkable
class EpisodeSource(Protocol):
    """What training asks of an episode; `dnet.datasets.reader.EpisodeReader` is one."""

    @property
    def path(self) -> Place:
        """Where it came from, for errors."""
        ...

    @property
    def kinds(self) -> tuple[FrameKind, ...]:
        """What each frame is."""
        ...

    def frame(self, index: int) -> Frame:
        """Return all of frame `index`."""
        ...


@dataclass(frozen=True, slots=True)
class Frames:
    """The settled frames of some episodes, those of one episode together."""

    clouds: tuple[tuple[Neighbourhoods, ...], ...]
    """Of every frame: its cloud with one or several choices of centroids, the usual one first."""
    grasps: Float32[Tensor, "n 3"]
    """The manipulation point at each frame, in metres."""
    rest: Bool[Tensor, " n"]
    """Which frames show the rest shape."""
    lengths: tuple[int, ...]
    """Frames of each episode, in order."""

    @property
    def pairs(self) -> int:
        """How many ordered pairs of frames of one episode there are."""
        return sum(length * (length - 1) for length in self.lengths)

    @property
    def episodes(self) -> tuple[range, ...]:
        """Rows of each episode."""
        ends = np.cumsum(self.lengths).tolist()
        return tuple(
            range(end - length, end) for end, length in zip(ends, self.lengths, strict=True)
        )

    def all_pairs(self) -> tuple[Int64[Tensor, " p"], Int64[Tensor, " p"]]:
        """Return the rows of the current and of the goal frame of every ordered pair."""
        current, goal = [], []
        for rows in self.episodes:
            one, other = ordered_pairs(len(rows))
            current.append(torch.from_numpy(one) + rows.start)
            goal.append(torch.from_numpy(other) + rows.start)
        return torch.cat(current), torch.cat(goal)

    def motions(
        self, current: Int64[Tensor, " p"], goal: Int64[Tensor, " p"]
    ) -> Float32[Tensor, "p 3"]:
        """Return the motion of the grasp between frames of these rows, in metres."""
        return self.grasps[goal] - self.grasps[current]


def settled(kinds: tuple[FrameKind, ...]) -> list[int]:
    """Return the numbers of the frames that pairs are made of."""
    return [index for index, kind in enumerate(kinds) if kind in SETTLED]


def samplings_for(count: int) -> int:
    """Return how many choices of centroids to keep of each of `count` clouds.

    Few clouds need many; many have variety enough, and would not fit in memory.
    """
    return max(1, min(MOST_SAMPLINGS, 20_000 // count))


def read_frames(
    episodes: Iterable[EpisodeSource],
    config: DeformerNetConfig,
    *,
    samplings: int = 1,
    seed: int = 0,
    find: FindNeighbourhoods = find_each,
    on_cloud: Callable[[], None] = lambda: None,
) -> Frames:
    """Read every settled frame of `episodes` and find its neighbourhoods.

    An episode with fewer than two settled frames has no pair and is left out.

    Args:
        episodes: Opened one after another.
        config: Of the network that will see the frames.
        samplings: How many choices of centroids to keep of each cloud. The network must not
            care which points happen to be centroids; with few frames it learns that only from
            seeing the same cloud with others.
        seed: Of all choices of centroids but the usual one.
        find: Finds the neighbourhoods of an episode's clouds, or has them already.
        on_cloud: Called after each cloud.

    Raises:
        BadEpisode: If a cloud has another number of points than the network takes.
        BadCloud: If a coordinate is NaN or infinite.
        TooFew: If no episode has two settled frames.
    """
    clouds: list[tuple[Neighbourhoods, ...]] = []
    rng = np.random.default_rng(seed)
    grasps: list[Point] = []
    rest: list[bool] = []
    lengths: list[int] = []
    groupings = GROUPINGS[config.size]
    for episode in episodes:
        chosen = settled(episode.kinds)
        if len(chosen) < 2:
            continue
        seen = [episode.frame(index) for index in chosen]
        for frame in seen:
            _check_points(frame, config, path=episode.path)
        usual = {index: frame.cloud for index, frame in zip(chosen, seen, strict=True)}
        found = find(episode.path, usual, config)
        for frame, cloud in zip(seen, found, strict=True):
            starts = rng.integers(config.points, size=samplings - 1).tolist()
            clouds.append((cloud, *(regroup(cloud, groupings, start=start) for start in starts)))
            grasps.append(frame.grasp)
            rest.append(frame.kind == "rest")
            on_cloud()
        lengths.append(len(chosen))
    if not lengths:
        raise TooFew("number of episodes with two settled frames", 0, 1)
    return Frames(
        tuple(clouds),
        torch.from_numpy(np.stack(grasps).astype(np.float32)),
        torch.tensor(rest),
        tuple(lengths),
    )


def _check_points(frame: Frame, config: DeformerNetConfig, *, path: Place) -> None:
    if len(frame.cloud) != config.points:
        raise BadEpisode(
            path,
            f"has clouds of {len(frame.cloud)} points, the first episode's have {config.points}",
            "train on episodes that were recorded with one number of points",
        )
