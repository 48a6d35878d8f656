"""DeformerNet: from the current and the goal cloud to the motion of the grasp between them."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Float32, Float64
from torch import Tensor, nn

from dnet.errors import BadCloud, LongCloud, ShortCloud, TooFew
from dnet.geometry.sampling import farthest_points
from dnet.nets.neighbourhoods import (
    GROUPINGS,
    MOST_POINTS,
    Neighbourhoods,
    Size,
    find_neighbourhoods,
    stack,
)
from dnet.nets.pointconv import Norm, SetAbstraction, gather, make_norm
from dnet.types import Cloud, Point

Coordinates = Literal["world", "centred", "scaled"]

UNITS: dict[Coordinates, float] = {"world": 1.0, "centred": 0.1, "scaled": 0.1}
"""Metres that a network of each kind of coordinates sees as 1."""


@dataclass(frozen=True, slots=True)
class DeformerNetConfig:
    """All that is needed to build a network, its weights aside."""

    size: Size = "light"
    """Levels of the encoder: `light` 128/16, 32/32 centroids/neighbours, `paper` 512/32, 128/64."""
    norm: Norm = "group"
    """Normalisation: `group`, or `batch` as the paper states."""
    points: int = 2048
    """Points of a cloud."""
    coordinates: Coordinates = "scaled"
    """How the network sees a cloud: `world`: in metres, as in the paper; `scaled`: in units of
    0.1 m, an object's size, at which the densities of PointConv tell crowded points from lonely
    ones; `centred`: the same about the goal's centroid, in training about the rest shape's."""
    density: bool = True
    """Whether features are weighed by how crowded their points are."""
    motion_unit: float = 0.01
    """Metres that the network's output of 1 stands for: a typical motion."""

    @property
    def coordinate_unit(self) -> float:
        """Metres that the network sees as 1."""
        return UNITS[self.coordinates]

    def __post_init__(self) -> None:
        first = GROUPINGS[self.size][0]
        least = max(first.centroids, first.neighbours)
        if self.points < least:
            raise TooFew(f"points of a cloud for a {self.size} network", self.points, least)
        if self.points > MOST_POINTS:
            raise LongCloud("cloud", self.points, MOST_POINTS)


class Levels(NamedTuple):
    """What an encoder finds at each of its levels, coordinates in the network's unit."""

    first: tuple[Float[Tensor, "b s1 3"], Float[Tensor, "b s1 64"]]
    """Centroids and their features."""
    second: tuple[Float[Tensor, "b s2 3"], Float[Tensor, "b s2 128"]]
    whole: Float[Tensor, "b 256"]
    """Features of the cloud."""


class Encoder(nn.Module):
    """Three levels of set abstraction: a cloud becomes 256 numbers."""

    widths = (64, 128, 256)
    features = widths[-1]

    def __init__(self, norm: Norm, *, density: bool = True) -> None:
        super().__init__()
        first, second, third = self.widths
        self.first = SetAbstraction(3, first, norm, density=density)
        self.second = SetAbstraction(first, second, norm, density=density)
        self.third = SetAbstraction(second, third, norm, density=density)

    def forward(self, clouds: Neighbourhoods) -> Float[Tensor, "b 256"]:
        """Return the features of each cloud of a batch."""
        return self.levels(clouds).whole

    def levels(self, clouds: Neighbourhoods) -> Levels:
        """Return what is found at each level, for those who need features of places too."""
        below, scales = clouds.points, clouds.inverse_densities
        middle = gather(below, clouds.centroids)
        near = self.first(
            below,
            below,
            centroids=middle,
            neighbours=clouds.neighbours[0],
            inverse_density=scales[0],
        )
        above = middle[:, : scales[2].shape[1]]
        far = self.second(
            middle,
            near,
            centroids=above,
            neighbours=clouds.neighbours[1],
            inverse_density=scales[1],
        )
        centre = above.mean(dim=1, keepdim=True)
        whole: Tensor = self.third(
            above, far, centroids=centre, neighbours=None, inverse_density=scales[2]
        )
        return Levels((middle, near), (above, far), whole[:, 0])


class Head(nn.Module):
    """Fully connected layers: features, or a difference of them, become three numbers."""

    widths = (128, 64, 32)

    def __init__(self, norm: Norm, *, inputs: int = Encoder.features) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for below, above in pairwise((inputs, *self.widths)):
            layers += [nn.Linear(below, above), make_norm(norm, above), nn.ReLU(inplace=True)]
        self.hidden = nn.Sequential(*layers)
        self.output = nn.Linear(self.widths[-1], 3)

    def forward(self, features: Float[Tensor, "p c"]) -> Float[Tensor, "p 3"]:
        """Return a motion, or a place, in the network's unit."""
        answer: Tensor = self.output(self.hidden(features))
        return answer


class DeformerNet(nn.Module):
    """The network of Thach et al.: one encoder for both clouds, features subtracted, a head.

    Since only features meet, a cloud is encoded once for all the pairs that it is part of.
    """

    def __init__(self, config: DeformerNetConfig | None = None) -> None:
        super().__init__()
        self.config = config or DeformerNetConfig()
        self.encoder = Encoder(self.config.norm, density=self.config.density)
        self.head = Head(self.config.norm)
        self._remembered: _Remembered | None = None

    def forward(self, current: Neighbourhoods, goal: Neighbourhoods) -> Float[Tensor, "b 3"]:
        """Return the motion of the grasp from each current to each goal cloud, in metres."""
        return self.motion(self.encode(current), self.encode(goal))

    def encode(self, clouds: Neighbourhoods) -> Float[Tensor, "b 256"]:
        """Return the features of each cloud of a batch, from `prepare`."""
        features: Tensor = self.encoder(clouds)
        return features

    def motion(
        self, current: Float[Tensor, "p 256"], goal: Float[Tensor, "p 256"]
    ) -> Float[Tensor, "p 3"]:
        """Return the motion between clouds of these features, in metres."""
        motion: Tensor = self.head(goal - current)
        return motion * self.config.motion_unit

    @torch.no_grad()
    def predict(self, current: Cloud, goal: Cloud) -> Point:
        """Return the motion of the grasp that would turn `current` into `goal`, in metres.

        Of a cloud with more points than the network takes, the farthest from each other are
        taken. The goal is encoded once, as long as the next call has the same one.

        Args:
            current: What is seen, in metres in the world frame.
            goal: What should be seen, likewise.

        Raises:
            ShortCloud: If a cloud has fewer points than the network takes.
            BadCloud: If a coordinate is NaN or infinite.
        """
        was_training = self.training
        self.eval()
        try:
            there = self._goal_features(goal)
            here = self._features(current, "current cloud", about=goal)
            motion = self.motion(here, there)[0]
        finally:
            self.train(was_training)
        return motion.cpu().numpy().astype(np.float64)

    def _goal_features(self, goal: Cloud) -> Float[Tensor, "1 256"]:
        # Weights tell by their version whether they have been trained or loaded since.
        version = sum(weights._version for weights in self.state_dict().values())
        kept = self._remembered
        if kept is None or kept.version != version or not np.array_equal(kept.goal, goal):
            features = self._features(goal, "goal cloud", about=goal)
            kept = self._remembered = _Remembered(goal.copy(), version, features)
        return kept.features.to(self._device)

    def _features(self, cloud: Cloud, what: str, *, about: Cloud) -> Float[Tensor, "1 256"]:
        return self.encode(
            prepare_seen(cloud, self.config, what=what, about=about).to(self._device)
        )

    @property
    def _device(self) -> torch.device:
        return next(self.parameters()).device


class _Remembered(NamedTuple):
    goal: Cloud
    version: int
    """Of the weights."""
    features: Float[Tensor, "1 256"]


def prepare(
    cloud: Cloud, config: DeformerNetConfig, *, what: str = "cloud", centre: Point | None = None
) -> Neighbourhoods:
    """Return a cloud as a network of `config` takes it.

    Args:
        cloud: Points in metres in the world frame.
        config: Of the network.
        what: Name of the cloud in an error.
        centre: What becomes the origin, in metres, if coordinates are to be centred.

    Raises:
        ShortCloud: If the cloud has fewer points than the network takes.
        LongCloud: If it has more.
        BadCloud: If a coordinate is NaN or infinite.
    """
    cloud = checked(cloud, config.points, what=what)
    (points,) = in_unit(cloud[None], config, centres=None if centre is None else centre[None])
    return find_neighbourhoods(points, GROUPINGS[config.size])


def checked(cloud: Cloud, points: int, *, what: str = "cloud") -> Cloud:
    """Return a cloud that has exactly so many points, all of them numbers.

    Raises:
        ShortCloud: If it has fewer.
        LongCloud: If it has more.
        BadCloud: If a coordinate is NaN or infinite.
    """
    if len(cloud) < points:
        raise ShortCloud(len(cloud), points)
    if len(cloud) > points:
        raise LongCloud(what, len(cloud), points)
    bad = int((~np.isfinite(cloud).all(axis=1)).sum())
    if bad:
        raise BadCloud(what, bad, len(cloud))
    return cloud


def prepare_seen(
    cloud: Cloud, config: DeformerNetConfig, *, what: str, about: Cloud
) -> Neighbourhoods:
    """Return a cloud to predict from, as a batch of one, as a network of `config` takes it.

    Of a cloud with more points than the network takes, the farthest from each other are taken.

    Args:
        cloud: Points in metres in the world frame.
        config: Of the network.
        what: Name of the cloud in an error.
        about: The goal, whose centroid becomes the origin if coordinates are to be centred.

    Raises:
        ShortCloud: If the cloud has fewer points than the network takes.
        BadCloud: If a coordinate is NaN or infinite.
    """
    if len(cloud) > config.points:
        cloud = farthest_points(cloud, config.points)
    return stack([prepare(cloud, config, what=what, centre=centroid(about))])


def centroid(cloud: Cloud) -> Point:
    """Return the mean of the points of a cloud."""
    return cloud.mean(axis=0, dtype=np.float64)


def in_unit(
    clouds: Float32[np.ndarray, "b n 3"],
    config: DeformerNetConfig,
    *,
    centres: Float64[np.ndarray, "b 3"] | None = None,
) -> Float32[np.ndarray, "b n 3"]:
    """Return clouds in metres in the unit of a network of `config`.

    Args:
        clouds: In the world frame.
        config: Of the network.
        centres: What becomes the origin of each, in metres, if coordinates are to be centred.
    """
    if centres is not None and config.coordinates == "centred":
        clouds = clouds - centres[:, None].astype(np.float32)
    return (clouds / np.float32(config.coordinate_unit)).astype(np.float32, copy=False)
