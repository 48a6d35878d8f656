"""The loss of a keypoint network on groups of frames, each encoded once for all its pairs."""

from dataclasses import dataclass, field

import torch
from jaxtyping import Float, Int64
from torch import Tensor

from dnet.nets.keypoints import KeypointNet
from dnet.training.keypoint_loss import KeypointLoss, KeypointLossWeights, keypoint_loss

Pairs = Int64[Tensor, "p"]


@dataclass(frozen=True, slots=True)
class KeypointObjective:
    """How a keypoint network is judged while it learns."""

    weights: KeypointLossWeights = field(default_factory=KeypointLossWeights)
    """How much each term of the loss counts."""
    points: int = 256
    """Points of each cloud that are carried and compared: its first ones, which lie evenly. The
    time of a step grows with the square."""
    neighbours: int = 8
    """Nearest points to which a point keeps its distance."""

    def loss(
        self,
        net: KeypointNet,
        clouds: Float[Tensor, "k n 3"],
        features: Float[Tensor, "k 256"],
        *,
        current: Pairs,
        goal: Pairs,
    ) -> KeypointLoss:
        """Return the loss of each pair of a batch.

        Args:
            net: Whose carrier moves points.
            clouds: In the network's unit, in farthest-point order.
            features: Of the clouds, by the network's encoder.
            current: Of each pair: which of the clouds is carried.
            goal: Of each pair: which it is carried to. With each pair its reverse is there.
        """
        points = clouds[:, : self.points]
        fields = net.carrier.fields(points, features)
        vectors = net.carrier.vectors(features[current], features[goal])
        moves = fields[current] @ vectors
        return keypoint_loss(
            points[current],
            moves,
            points[goal],
            reverse=moves[reverse_of(current, goal, len(clouds))],
            neighbours=near(points, self.neighbours)[current],
            weights=self.weights,
        )


def reverse_of(current: Pairs, goal: Pairs, clouds: int) -> Pairs:
    """Return, for each pair, the number of the pair that goes the other way."""
    numbers = torch.full((clouds, clouds), -1, device=current.device)
    numbers[current, goal] = torch.arange(len(current), device=current.device)
    return numbers[goal, current]


@torch.no_grad()
def near(points: Float[Tensor, "k n 3"], count: int) -> Int64[Tensor, "k n {count}"]:
    """Return the rows of the points nearest to each, itself not among them."""
    centred = points - points.mean(dim=1, keepdim=True)
    return torch.cdist(centred, centred).topk(count + 1, largest=False).indices[..., 1:]
