"""DeformerNet: from the current and the goal cloud to the motion of the grasp between them."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import torch
from jaxtyping import Float, Float32
from torch import Tensor, nn

from dnet.errors import BadCloud, LongCloud, ShortCloud, TooFew
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


@dataclass(frozen=True, slots=True)
class DeformerNetConfig:
    """All that is needed to build a network, its weights aside."""

    size: Size = "light"
    """Levels of the encoder: `light` 128/16, 32/32 centroids/neighbours, `paper` 512/32, 128/64."""
    norm: Norm = "group"
    """Normalisation: `group`, or `batch` as the paper states."""
    points: int = 2048
    """Points of a cloud."""
    coordinate_unit: float = 0.1
    """Metres that the network sees as 1, about the world's origin: an object's size, at which
    the densities of PointConv tell crowded points from lonely ones."""
    motion_unit: float = 0.01
    """Metres that the network's output of 1 stands for: a typical motion."""

    def __post_init__(self) -> None:
        first = GROUPINGS[self.size][0]
        least = max(first.centroids, first.neighbours)
        if self.points < least:
            raise TooFew(f"points of a cloud for a {self.size} network", self.points, least)
        if self.points > MOST_POINTS:
            raise LongCloud("cloud", self.points, MOST_POINTS)


class Encoder(nn.Module):
    """Three levels of set abstraction: a cloud becomes 256 numbers."""

    features = 256

    def __init__(self, norm: Norm) -> None:
        super().__init__()
        self.first = SetAbstraction(3, 64, norm)
        self.second = SetAbstraction(64, 128, norm)
        self.third = SetAbstraction(128, self.features, norm)

    def forward(self, clouds: Neighbourhoods) -> Float[Tensor, "b 256"]:
        """Return the features of each cloud of a batch."""
        below, scales = clouds.points, clouds.inverse_densities
        middle = gather(below, clouds.centroids)
        features = self.first(
            below,
            below,
            centroids=middle,
            neighbours=clouds.neighbours[0],
            inverse_density=scales[0],
        )
        above = middle[:, : scales[2].shape[1]]
        features = self.second(
            middle,
            features,
            centroids=above,
            neighbours=clouds.neighbours[1],
            inverse_density=scales[1],
        )
        centre = above.mean(dim=1, keepdim=True)
        whole: Tensor = self.third(
            above, features, centroids=centre, neighbours=None, inverse_density=scales[2]
        )
        return whole[:, 0]


class Head(nn.Module):
    """Fully connected layers: a difference of features becomes a motion."""

    widths = (Encoder.features, 128, 64, 32)

    def __init__(self, norm: Norm) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for inputs, outputs in pairwise(self.widths):
            layers += [nn.Linear(inputs, outputs), make_norm(norm, outputs), nn.ReLU(inplace=True)]
        self.hidden = nn.Sequential(*layers)
        self.output = nn.Linear(self.widths[-1], 3)

    def forward(self, difference: Float[Tensor, "p 256"]) -> Float[Tensor, "p 3"]:
        """Return the motion in the network's unit."""
        motion: Tensor = self.output(self.hidden(difference))
        return motion


class DeformerNet(nn.Module):
    """The network of Thach et al.: one encoder for both clouds, features subtracted, a head.

    Since only features meet, a cloud is encoded once for all the pairs that it is part of.
    """

    def __init__(self, config: DeformerNetConfig | None = None) -> None:
        super().__init__()
        self.config = config or DeformerNetConfig()
        self.encoder = Encoder(self.config.norm)
        self.head = Head(self.config.norm)

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

        Args:
            current: What is seen, in metres in the world frame.
            goal: What should be seen, likewise.

        Raises:
            ShortCloud: If a cloud has fewer points than the network takes.
            LongCloud: If it has more.
            BadCloud: If a coordinate is NaN or infinite.
        """
        device = next(self.parameters()).device
        pair = [
            prepare(cloud, self.config, what=what)
            for what, cloud in (("current cloud", current), ("goal cloud", goal))
        ]
        was_training = self.training
        self.eval()
        try:
            features = self.encode(stack(pair).to(device))
            motion = self.motion(features[:1], features[1:])[0]
        finally:
            self.train(was_training)
        return motion.cpu().numpy().astype(np.float64)


def prepare(cloud: Cloud, config: DeformerNetConfig, *, what: str = "cloud") -> Neighbourhoods:
    """Return a cloud as a network of `config` takes it.

    Args:
        cloud: Points in metres in the world frame.
        config: Of the network.
        what: Name of the cloud in an error.

    Raises:
        ShortCloud: If the cloud has fewer points than the network takes.
        LongCloud: If it has more.
        BadCloud: If a coordinate is NaN or infinite.
    """
    if len(cloud) < config.points:
        raise ShortCloud(len(cloud), config.points)
    if len(cloud) > config.points:
        raise LongCloud(what, len(cloud), config.points)
    bad = int((~np.isfinite(cloud).all(axis=1)).sum())
    if bad:
        raise BadCloud(what, bad, len(cloud))
    return find_neighbourhoods(in_unit(cloud, config), GROUPINGS[config.size])


def in_unit(
    clouds: Float32[np.ndarray, "*batch n 3"], config: DeformerNetConfig
) -> Float32[np.ndarray, "*batch n 3"]:
    """Return clouds in metres in the unit of a network of `config`."""
    return (clouds / config.coordinate_unit).astype(np.float32)
