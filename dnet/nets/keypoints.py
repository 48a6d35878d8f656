"""Keypoints with numbers: 200 points of an object, and where each of them is in a goal cloud.

Learned without labels: two frames of one episode show one object, so that what carries the one
into the other must have found which point is which.

Sources. Carrying what belongs to a keypoint from frame to frame, and judging that by the other
frame alone, is the Transporter (Kulkarni et al. 2019), which carries features between images;
clouds have no pixels, so here points are carried, and the Chamfer distance judges. That keypoints
begin as a farthest-point sample of the source, and that a deformation of the source driven by the
difference of two codes is judged so, is KeypointDeformer (Jakab et al. 2021). That keypoint k is
the same point in every cloud is the aim of Skeleton Merger (Shi et al. 2021), which has one output
for each; with one output for every point of the object, any sample of it may be the keypoints.
That distances between neighbours persist on a deforming body is SelfGeo (Zohaib et al. 2024), and
that a displacement is a sum of fields over space times what is sensed, DeepONet (Lu et al. 2021).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Float32
from torch import Tensor, nn

from dnet.errors import BadCloud, ShortCloud, TooFew
from dnet.geometry.chamfer import chamfer
from dnet.geometry.fit import fit
from dnet.geometry.sampling import farthest_rows
from dnet.nets.deformernet import DeformerNetConfig, Encoder, prepare
from dnet.nets.neighbourhoods import Neighbourhoods, stack
from dnet.types import Cloud

FITTED = 1024
"""Points of the initial cloud that are carried to the goal and fitted to it."""


KEYPOINTS = 200
"""Keypoints of an object, as in the paper."""
STILL = 1e-3
"""Standard deviation up to which a channel of the encoder is not scaled."""
FIELDS, WIDTH = 96, 96
"""Smooth fields over the object that a displacement is made of, and channels of the layers that
make them; those that weigh them are twice as wide."""


@dataclass(frozen=True, slots=True)
class Keypoints:
    """The keypoints of an object in two clouds: row k of both is the same point of it."""

    initial: Float32[np.ndarray, "k 3"]
    """In the initial cloud: points of it, each the farthest from those before it, in metres."""
    goal: Float32[np.ndarray, "k 3"]
    """Where they are in the goal, in metres."""
    residual: float
    """Symmetric mean Chamfer distance between the initial cloud, carried to the goal, and the goal
    cloud, in metres: large if that shows another object, or a shape never seen."""


class Carrier(nn.Module):
    """Says how far the points of one cloud move on the way to another.

    A displacement is a sum of fields, which depend on the cloud that points are of, each times a
    vector, which depends on both clouds: all goals of a cloud share its fields. The vectors are
    those of the goal less those of the cloud itself, so that a cloud stays where it is on the way
    to itself, trained or not.
    """

    def __init__(self, fields: int, width: int) -> None:
        super().__init__()
        self.point = nn.Linear(3, width)
        self.cloud = nn.Linear(Encoder.features, width)
        self.space = nn.Sequential(
            nn.SiLU(),
            nn.Linear(width, width),
            nn.SiLU(),
            nn.Linear(width, width),
            nn.SiLU(),
            nn.Linear(width, fields),
        )
        self.change = nn.Sequential(
            nn.Linear(2 * Encoder.features, 2 * width),
            nn.SiLU(),
            nn.Linear(2 * width, 2 * width),
            nn.SiLU(),
            nn.Linear(2 * width, 3 * fields, bias=False),
        )
        # So that first displacements are as small as a sum of many terms should be.
        self.scale = fields**-0.5

    def fields(
        self, points: Float[Tensor, "b n 3"], start: Float[Tensor, "b 256"]
    ) -> Float[Tensor, "b n f"]:
        """Return the fields of clouds at points, in the network's unit."""
        return self.space(self.point(points) + self.cloud(start)[:, None])

    def vectors(
        self, start: Float[Tensor, "p 256"], end: Float[Tensor, "p 256"]
    ) -> Float[Tensor, "p f 3"]:
        """Return what the fields of the first clouds are multiplied by on the way to the second."""
        moving = self.change(torch.cat([start, end - start], dim=-1))
        still = self.change(torch.cat([start, torch.zeros_like(start)], dim=-1))
        return ((moving - still) * self.scale).unflatten(-1, (-1, 3))


class KeypointNet(nn.Module):
    """An encoder for clouds, and a carrier that moves points as the object deforms.

    The encoder is that of a trained DeformerNet, and stays as it is: one that learns along from
    clouds alone forgets what tells motions along the surface, which hardly change a cloud.

    Args:
        config: How the network sees a cloud: its encoder is that of DeformerNet.
        count: Keypoints of an object; at most as many as a cloud has points.
    """

    def __init__(self, config: DeformerNetConfig | None = None, *, count: int = KEYPOINTS) -> None:
        super().__init__()
        if count < 1:
            raise TooFew("number of keypoints", count, 1)
        self.config = config or DeformerNetConfig()
        self.count = min(count, self.config.points)
        self.encoder = Encoder(self.config.norm, density=self.config.density).requires_grad_(False)
        self.middle: Tensor
        self.spread: Tensor
        self.register_buffer("middle", torch.zeros(Encoder.features))
        self.register_buffer("spread", torch.ones(Encoder.features))
        self.carrier = Carrier(FIELDS, WIDTH)

    def train(self, mode: bool = True) -> "KeypointNet":
        """Train, or not; the encoder never does."""
        super().train(mode)
        self.encoder.eval()
        return self

    @torch.no_grad()
    def encode(self, clouds: Neighbourhoods) -> Float[Tensor, "b 256"]:
        """Return the scaled features of each cloud of a batch, from `prepare`."""
        features: Tensor = self.encoder(clouds)
        return (features - self.middle) / self.spread

    @property
    def scaled(self) -> bool:
        """Whether features have been scaled."""
        return bool((self.spread != 1).any() or (self.middle != 0).any())

    @torch.no_grad()
    def scale(self, features: Float[Tensor, "n 256"]) -> None:
        """Give features like these mean 0 and variance 1 from now on, channel by channel.

        The encoder was trained with a head of its own, to which it did not matter that some
        channels vary a hundred times as much as others.

        Args:
            features: Of clouds to train on, as `encode` returns them, two or more.
        """
        spread = features.std(dim=0, correction=0)
        self.middle += features.mean(dim=0) * self.spread
        # A channel that hardly ever fires would drown the others where it does.
        self.spread *= torch.where(spread > STILL, spread, torch.ones_like(spread))

    def displacements(
        self,
        points: Float[Tensor, "p n 3"],
        start: Float[Tensor, "p 256"],
        end: Float[Tensor, "p 256"],
    ) -> Float[Tensor, "p n 3"]:
        """Return how far points move on the way to other clouds, in the network's unit.

        Args:
            points: Of each first cloud, in the network's unit: any, however many.
            start: Features of the first clouds.
            end: Features of the second.
        """
        return self.carrier.fields(points, start) @ self.carrier.vectors(start, end)

    @torch.no_grad()
    def keypoints(self, initial: Cloud, goal: Cloud) -> Keypoints:
        """Return the keypoints of an object in its initial and its goal cloud.

        What the network carries is then fitted to the goal, smoothly: the network says which
        point is which, and the goal where the surface is. The order of points does not matter.
        Clouds may differ in size; of one with more points than the network takes, the farthest
        from each other are taken.

        Args:
            initial: The object before any motion, in metres in the world frame, (n, 3).
            goal: The shape to reach, likewise, (m, 3).

        Raises:
            ShortCloud: If a cloud has fewer points than the network takes.
            BadCloud: If a coordinate is NaN or infinite.
        """
        was_training = self.training
        self.eval()
        try:
            here = self._seen(initial, "initial cloud")
            there = self._seen(goal, "goal cloud")
            start, end = self.encode(stack([here.seen, there.seen]).to(self._device))[:, None]
            points = here.seen.points[None, : self._fitted].to(self._device)
            moved = self.displacements(points, start, end)[0].cpu().numpy()
        finally:
            self.train(was_training)
        cloud = here.cloud[: self._fitted]
        unit = np.float32(self.config.coordinate_unit)
        carried = fit(cloud, cloud + moved * unit, there.cloud)
        count = self.count
        return Keypoints(cloud[:count], carried[:count], chamfer(carried, there.cloud))

    def _seen(self, cloud: Cloud, what: str) -> "_Seen":
        points = self.config.points
        if len(cloud) < points:
            raise ShortCloud(len(cloud), points)
        bad = int((~np.isfinite(cloud).all(axis=1)).sum())
        if bad:
            raise BadCloud(what, bad, len(cloud))
        ordered = in_own_order(cloud, points, least=self._fitted)
        return _Seen(ordered, prepare(ordered, self.config, what=what))

    @property
    def _fitted(self) -> int:
        """Points that are carried: enough to know the surface by."""
        return min(self.config.points, max(FITTED, self.count))

    @property
    def _device(self) -> torch.device:
        return next(self.parameters()).device


class _Seen(NamedTuple):
    cloud: Cloud
    """In metres."""
    seen: Neighbourhoods


def in_own_order(cloud: Cloud, count: int, *, least: int) -> Cloud:
    """Return `count` points of a cloud in an order that depends on where they are alone.

    Args:
        cloud: With `count` points or more, in any order, in metres.
        count: How many points; if the cloud has more, the farthest from each other.
        least: How many at the front are a farthest-point sample in any case.
    """
    away = np.square(cloud - cloud.mean(axis=0, dtype=np.float64)).sum(axis=1)
    sampled = count if len(cloud) > count else max(least, 1)
    first = farthest_rows(cloud, sampled, start=int(away.argmax()))
    if sampled == count:
        return cloud[first]
    others = np.setdiff1d(np.arange(len(cloud)), first)
    return cloud[np.concatenate([first, others])]
