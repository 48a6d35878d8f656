"""What a keypoint network is taught by: clouds alone, two frames of one episode at a time.

Three terms, in the network's unit. Clouds carried to other frames should cover what is seen there
(Chamfer distance; both are partial, so distances are not squared: what only one of them shows is
an outlier). Near points should keep their distances, as those of a body that stretches little do.
And the way back should undo the way there.
"""

from dataclasses import dataclass

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from dnet.nets.pointconv import gather

Points = Float[Tensor, "p n 3"]

# Below this, in the network's unit, a distance has no slope: 0.01 mm at a unit of 0.1 m.
_SMOOTH = 1e-4


@dataclass(frozen=True, slots=True)
class KeypointLossWeights:
    """How much each term counts, beside a Chamfer distance of weight 1."""

    isometry: float = 0.005
    """Of the mean squared relative stretch between neighbours."""
    back: float = 0.1
    """Of the mean distance between where a point came from and where the way back takes it."""


@dataclass(frozen=True, slots=True)
class KeypointLoss:
    """The loss of each pair of a batch, and what it is made of."""

    total: Float[Tensor, " p"]
    chamfer: Float[Tensor, " p"]
    isometry: Float[Tensor, " p"]
    back: Float[Tensor, " p"]


def keypoint_loss(
    start: Points,
    displacements: Points,
    end: Float[Tensor, "p m 3"],
    *,
    reverse: Float[Tensor, "p m 3"],
    neighbours: Int64[Tensor, "p n k"],
    weights: KeypointLossWeights,
) -> KeypointLoss:
    """Return how badly points are carried between pairs of clouds.

    Args:
        start: Points of the first cloud of each pair.
        displacements: How far they are carried.
        end: Points of the second cloud.
        reverse: How far those are carried on the way back.
        neighbours: Rows of `start` near each point, itself not among them.
        weights: How much each term counts.
    """
    moved = start + displacements
    nearest = Nearest.between(moved, end)
    chamfer = nearest.chamfer(moved, end)
    isometry = stretch(start, moved, neighbours)
    # The way back is known at the points of the second cloud, of which one is near.
    back = lengths(displacements + gather(reverse, nearest.there)).mean(dim=1)
    total = chamfer + weights.isometry * isometry + weights.back * back
    return KeypointLoss(total, chamfer, isometry, back)


@dataclass(frozen=True, slots=True)
class Nearest:
    """Who is nearest to whom between two clouds of each pair; no gradient flows through it."""

    there: Int64[Tensor, "p n"]
    """Of each point of the first cloud: the row of the second."""
    back: Int64[Tensor, "p m"]
    """Of each point of the second cloud: the row of the first."""

    @classmethod
    @torch.no_grad()
    def between(cls, one: Points, other: Float[Tensor, "p m 3"]) -> "Nearest":
        """Find them."""
        # About a common origin float32 has digits enough for the fast way to distances.
        origin = other.mean(dim=1, keepdim=True)
        distances = torch.cdist(one - origin, other - origin)
        return cls(distances.argmin(dim=2), distances.argmin(dim=1))

    def chamfer(self, one: Points, other: Float[Tensor, "p m 3"]) -> Float[Tensor, " p"]:
        """Return the symmetric mean Chamfer distance of each pair: that of both directions."""
        there = lengths(one - gather(other, self.there)).mean(dim=1)
        back = lengths(other - gather(one, self.back)).mean(dim=1)
        return (there + back) / 2


def stretch(
    start: Points, moved: Points, neighbours: Int64[Tensor, "p n k"]
) -> Float[Tensor, " p"]:
    """Return the mean squared relative change of distances to neighbours, zero if rigid."""
    before, after = (_edges(points, neighbours) for points in (start, moved))
    return ((after - before) / before).square().mean(dim=(1, 2))


def lengths(vectors: Float[Tensor, "*b 3"]) -> Float[Tensor, "*b"]:
    """Return the length of vectors, with a slope of zero at zero."""
    return (vectors.square().sum(dim=-1) + _SMOOTH**2).sqrt() - _SMOOTH


def _edges(points: Points, neighbours: Int64[Tensor, "p n k"]) -> Float[Tensor, "p n k"]:
    return (
        (gather(points, neighbours) - points[:, :, None]).square().sum(dim=-1) + _SMOOTH**2
    ).sqrt()
