"""More episodes from few: an object turned, shifted or mirrored deforms in the same way.

The motion of the grasp turns with the object, so these are exact, as long as every frame of an
episode moves alike; and they leave neighbours and densities as they are.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Float32, Int64
from torch import Tensor

from dnet.nets.neighbourhoods import Neighbourhoods


@dataclass(frozen=True, slots=True)
class Placement:
    """How each group of frames is placed anew in the world."""

    turns: Float32[Tensor, "g 3 3"]
    """Rotation about the vertical, or one followed by a reflection."""
    shifts: Float32[Tensor, "g 3"]
    """Translation, in metres."""


@dataclass(frozen=True, slots=True)
class Augmentation:
    """How far placements stray."""

    yaw: float = 0.3
    """Largest turn about the vertical through the world's origin."""
    shift: float = 0.015
    """Largest translation along x and along y."""
    mirror: bool = False
    """Whether every second placement swaps y and -y, on average."""

    def draw(self, rng: np.random.Generator, count: int) -> Placement:
        """Return `count` random placements."""
        yaw = rng.uniform(-self.yaw, self.yaw, count)
        flip = np.where(rng.random(count) < 0.5, -1.0, 1.0) if self.mirror else np.ones(count)
        turns = np.zeros((count, 3, 3))
        turns[:, 0, 0], turns[:, 0, 1] = np.cos(yaw), -np.sin(yaw)
        turns[:, 1, 0], turns[:, 1, 1] = flip * np.sin(yaw), flip * np.cos(yaw)
        turns[:, 2, 2] = 1
        shifts = np.zeros((count, 3))
        shifts[:, :2] = rng.uniform(-self.shift, self.shift, (count, 2))
        return Placement(
            torch.from_numpy(turns.astype(np.float32)), torch.from_numpy(shifts.astype(np.float32))
        )


def place(
    clouds: Neighbourhoods,
    placement: Placement,
    *,
    groups: Int64[Tensor, " b"],
    coordinate_unit: float,
) -> Neighbourhoods:
    """Return `clouds`, each placed as its group is.

    Args:
        clouds: A batch.
        placement: Of every group.
        groups: The group of each cloud.
        coordinate_unit: Metres that a coordinate of 1 stands for.
    """
    turned = torch.bmm(clouds.points, placement.turns[groups].transpose(1, 2))
    shifts = placement.shifts[groups] / coordinate_unit
    return replace(clouds, points=turned + shifts[:, None])


def turn(
    motions: Float32[Tensor, "p 3"], placement: Placement, *, groups: Int64[Tensor, " p"]
) -> Float32[Tensor, "p 3"]:
    """Return `motions` of the grasp, each turned as its group is; a shift leaves them."""
    return torch.bmm(placement.turns[groups], motions[..., None])[..., 0]
