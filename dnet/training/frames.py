"""The frames that a network learns from, in memory, their neighbourhoods found once."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import torch
from jaxtyping import Bool, Float32, Float64
from torch import Tensor

from dnet.errors import BadEpisode, TooFew
from dnet.nets.deformernet import DeformerNetConfig, prepare
from dnet.nets.neighbourhoods import Neighbourhoods, stack
from dnet.types import Cloud, FrameKind, Point

SETTLED: tuple[FrameKind, ...] = ("rest", "shape")
"""Kinds of frame that pairs are made of; what is seen on the way is still moving."""


class EpisodeSource(Protocol):
    """What training asks of an episode; `dnet.datasets.reader.EpisodeReader` is one."""

    @property
    def path(self) -> Path:
        """Where it came from, for errors."""
        ...

    @property
    def kinds(self) -> tuple[FrameKind, ...]:
        """What each frame is."""
        ...

    @property
    def grasps(self) -> Float64[np.ndarray, "_ 3"]:
        """The manipulation point at each frame, (n, 3)."""
        ...

    def cloud(self, index: int) -> Cloud:
        """Return the visible surface at frame `index`, in farthest-point order."""
        ...


@dataclass(frozen=True, slots=True)
class Frames:
    """The settled frames of some episodes, those of one episode together."""

    clouds: Neighbourhoods
    """Of every frame, (n, ...)."""
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

    def to(self, device: torch.device) -> "Frames":
        """Return the same frames on `device`."""
        return Frames(
            self.clouds.to(device), self.grasps.to(device), self.rest.to(device), self.lengths
        )


def settled(kinds: tuple[FrameKind, ...]) -> list[int]:
    """Return the numbers of the frames that pairs are made of."""
    return [index for index, kind in enumerate(kinds) if kind in SETTLED]


def read_frames(
    episodes: Iterable[EpisodeSource],
    config: DeformerNetConfig,
    *,
    on_cloud: Callable[[], None] = lambda: None,
) -> Frames:
    """Read every settled frame of `episodes` and find its neighbourhoods.

    An episode with fewer than two settled frames has no pair and is left out.

    Args:
        episodes: Opened one after another.
        config: Of the network that will see the frames.
        on_cloud: Called after each cloud.

    Raises:
        BadEpisode: If a cloud has another number of points than the network takes.
        BadCloud: If a coordinate is NaN or infinite.
        TooFew: If no episode has two settled frames.
    """
    clouds: list[Neighbourhoods] = []
    grasps: list[Point] = []
    rest: list[bool] = []
    lengths: list[int] = []
    for episode in episodes:
        chosen = settled(episode.kinds)
        if len(chosen) < 2:
            continue
        for index in chosen:
            clouds.append(_prepare(episode, index, config))
            grasps.append(episode.grasps[index])
            rest.append(episode.kinds[index] == "rest")
            on_cloud()
        lengths.append(len(chosen))
    if not lengths:
        raise TooFew("number of episodes with two settled frames", 0, 1)
    return Frames(
        stack(clouds),
        torch.from_numpy(np.stack(grasps).astype(np.float32)),
        torch.tensor(rest),
        tuple(lengths),
    )


def _prepare(episode: EpisodeSource, index: int, config: DeformerNetConfig) -> Neighbourhoods:
    cloud = episode.cloud(index)
    if len(cloud) != config.points:
        raise BadEpisode(
            episode.path,
            f"has a cloud of {len(cloud)} points at frame {index}, not {config.points}",
            "train on episodes that were recorded with one number of points",
        )
    return prepare(cloud, config, what=f"frame {index} of {episode.path}")
