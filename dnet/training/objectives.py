"""What each network is trained to do: from a batch to the loss of each of its pairs."""

from abc import ABC, abstractmethod
from typing import Any, Generic, TypeVar

import torch
from jaxtyping import Float, Int64
from torch import Tensor, nn

from dnet.nets.deformernet import DeformerNet, DeformerNetConfig
from dnet.nets.hu import HuNet, HuNetConfig
from dnet.nets.keypoints import KeypointNet
from dnet.nets.manipulation_point import DensePredictor, PointRegressor, surface
from dnet.nets.neighbourhoods import Neighbourhoods
from dnet.training.keypoint_batch import KeypointObjective

Network = DeformerNet | HuNet | PointRegressor | DensePredictor | KeypointNet
"""What can be trained."""
N = TypeVar("N", bound=Network)

LABEL_RADIUS = 0.005
"""Standard deviation of the Gaussian about the manipulation point that scores are compared with,
in metres: about the distance between the points of a cloud that are scored."""
LEARNED = 256
"""Points of a cloud that are scored in training, besides its hidden sides: half of those that a
choice is made from, for the sake of speed."""


class Objective(nn.Module, ABC, Generic[N]):
    """A network and its loss, as one call: what several processes average the gradient of."""

    network: N
    config: DeformerNetConfig | HuNetConfig
    """Of the network."""
    shown: float
    """What a loss is multiplied with to be told: squared errors in mm², distances in mm."""

    @abstractmethod
    def forward(
        self,
        clouds: Any,
        current: Tensor,
        goal: Tensor,
        motions: Tensor,
        points: Tensor,
    ) -> Float[Tensor, " p"]:
        """Return the loss of each pair; near 1 for an untrained network.

        Args:
            clouds: A batch, as the network takes it.
            current: Of each pair: which of the clouds is the current one.
            goal: Of each pair: which is the goal.
            motions: Of each pair: the true motion of the grasp, in metres, (p, 3).
            points: Of each pair: the true manipulation point of the current shape, likewise.
        """


class MotionError(Objective[DeformerNet | HuNet]):
    """Squared error of the motions between clouds, mean over x, y, z, in the network's unit."""

    def __init__(self, network: DeformerNet | HuNet) -> None:
        super().__init__()
        self.network, self.config = network, network.config
        self.shown = (1000 * network.config.motion_unit) ** 2

    def forward(
        self,
        clouds: Any,
        current: Tensor,
        goal: Tensor,
        motions: Tensor,
        points: Tensor,  # noqa: ARG002
    ) -> Float[Tensor, " p"]:
        """Return the squared error of each pair's motion."""
        features = self.network.encode(clouds)
        found = self.network.motion(features[current], features[goal])
        return _squared(found, motions, unit=self.config.motion_unit)


class PointError(Objective[PointRegressor]):
    """Squared error of a regressor's points, mean over x, y, z, in its unit."""

    def __init__(self, network: PointRegressor) -> None:
        super().__init__()
        self.network, self.config = network, network.config
        self.shown = (1000 * network.config.motion_unit) ** 2

    def forward(
        self,
        clouds: Neighbourhoods,
        current: Tensor,
        goal: Tensor,
        motions: Tensor,  # noqa: ARG002
        points: Tensor,
    ) -> Float[Tensor, " p"]:
        """Return the squared error of each pair's point."""
        rests, of = torch.unique(current, return_inverse=True)
        found = self.network(clouds.take(rests), clouds.take(goal), of)
        return _squared(found, points, unit=self.config.motion_unit)


class HeatMap(Objective[DensePredictor]):
    """How far a dense predictor's scores are from a Gaussian about the manipulation point.

    The Kullback-Leibler divergence of the one from the other, in nats, and the squared error of
    the motions that guide it, in its unit.
    """

    shown = 1.0

    def __init__(self, network: DensePredictor) -> None:
        super().__init__()
        self.network, self.config = network, network.config

    def forward(
        self,
        clouds: Neighbourhoods,
        current: Tensor,
        goal: Tensor,
        motions: Tensor,
        points: Tensor,
    ) -> Float[Tensor, " p"]:
        """Return the divergence of each pair's scores, and the error of its motion."""
        rests, of = torch.unique(current, return_inverse=True)
        initial = clouds.take(rests)
        candidates = surface(initial, LEARNED)
        found = self.network(initial, clouds.take(goal), of, candidates=candidates)
        labels = self._labels(candidates, of, points)
        divergence = (labels.exp() * (labels - found.scores.float())).sum(dim=1)
        return divergence + _squared(found.motion, motions, unit=self.config.motion_unit)

    def _labels(
        self,
        candidates: Float[Tensor, "b c 3"],
        of: Int64[Tensor, " p"],
        points: Float[Tensor, "p 3"],
    ) -> Float[Tensor, "p c"]:
        places = candidates[of] * self.network.config.coordinate_unit
        squares = (places - points[:, None]).square().sum(dim=2)
        return torch.log_softmax(-squares / (2 * LABEL_RADIUS**2), dim=1)


class CarryingError(Objective[KeypointNet]):
    """How badly a keypoint network carries clouds to one another; without labels."""

    def __init__(self, network: KeypointNet) -> None:
        super().__init__()
        self.network, self.config = network, network.config
        self.shown = 1000 * network.config.coordinate_unit
        self._loss = KeypointObjective()

    def forward(
        self,
        clouds: Neighbourhoods,
        current: Tensor,
        goal: Tensor,
        motions: Tensor,  # noqa: ARG002
        points: Tensor,  # noqa: ARG002
    ) -> Float[Tensor, " p"]:
        """Return the loss of each pair, whose reverse must be in the batch, too."""
        features = self.network.encode(clouds)
        loss = self._loss.loss(self.network, clouds.points, features, current=current, goal=goal)
        return loss.total


def _squared(
    found: Float[Tensor, "p 3"], true: Float[Tensor, "p 3"], *, unit: float
) -> Float[Tensor, " p"]:
    return ((found.float() - true) / unit).square().mean(dim=1)
