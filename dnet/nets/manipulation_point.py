"""Where to grasp, from the initial and the goal cloud: x_m = f(cloud_0, cloud_g).

Two networks on the encoder of DeformerNet: `PointRegressor` puts out a position (Thach, Kuntz and
Hermans, DeformerNet, 2021, section on manipulation points), `DensePredictor` a score for every
point of the initial cloud, the idea of the same group's later dense predictor (T-RO 2024), so that
its answer lies on the surface and its doubt can be seen.
"""

from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Float32, Int64
from torch import Tensor, nn
from torch.nn import functional

from dnet.geometry.hidden_sides import hidden_sides
from dnet.nets.deformernet import (
    DeformerNet,
    DeformerNetConfig,
    Encoder,
    Head,
    centroid,
    prepare,
)
from dnet.nets.neighbourhoods import Neighbourhoods, stack
from dnet.nets.pointconv import gather, make_norm
from dnet.types import Cloud, Point

SCORED = 512
"""Points of a cloud that a choice is made from, besides its hidden sides: 4 mm apart on an object
of 0.1 m."""


class Chosen(NamedTuple):
    """What a network makes of two clouds."""

    point: Point
    """Where to grasp, in metres."""
    candidates: Float32[np.ndarray, "c 3"] | None = None
    """Points of the surface that were scored: the first ones of the initial cloud, the farthest
    from each other, and the sides that are hidden from the camera; None of a regressor."""
    probabilities: Float32[np.ndarray, " c"] | None = None
    """Of each candidate."""


class Scored(NamedTuple):
    """What a dense predictor makes of a batch."""

    scores: Float[Tensor, "p c"]
    """Of each candidate, the logarithm of its probability."""
    motion: Float[Tensor, "p 3"]
    """Of the grasp, from the initial shape to the goal, in metres."""


class PointRegressor(nn.Module):
    """DeformerNet with a position as its output.

    The position is counted from the mean of the initial cloud; the head sees what the object
    looks like at rest besides how the goal differs, for a place depends on both.
    """

    def __init__(self, config: DeformerNetConfig | None = None) -> None:
        super().__init__()
        self.config = config or DeformerNetConfig()
        self.encoder = Encoder(self.config.norm, density=self.config.density)
        self.head = Head(self.config.norm, inputs=2 * Encoder.features)

    def forward(
        self, initial: Neighbourhoods, goal: Neighbourhoods, of: Int64[Tensor, " p"]
    ) -> Float[Tensor, "p 3"]:
        """Return where to grasp, in metres.

        Args:
            initial: A batch of clouds at rest.
            goal: A batch of p goals.
            of: Which of the initial clouds each goal belongs to.
        """
        here, there = self.encoder(initial)[of], self.encoder(goal)
        offset: Tensor = self.head(torch.cat([there - here, here], dim=1))
        return middle(initial, self.config)[of] + offset * self.config.motion_unit

    @torch.no_grad()
    def choose(self, initial: Cloud, goal: Cloud) -> Chosen:
        """Return where to grasp; the answer may lie off the surface.

        Raises:
            ShortCloud, LongCloud: If a cloud has not the number of points that the network takes.
            BadCloud: If a coordinate is NaN or infinite.
        """
        here, there = _prepared(initial, goal, self.config)
        point = self(here, there, torch.zeros(1, dtype=torch.int64))[0]
        return Chosen(point.numpy().astype(np.float64))


class DensePredictor(nn.Module):
    """A score for each point of the surface: how likely it is the manipulation point.

    The surface is the initial cloud and, since arms also grasp sides that the camera does not
    see, walls from its outline down to the table.

    A DeformerNet within tells by which motion of the grasp the goal was made, and is trained to,
    along with the scores. Near the manipulation point, which the jaws carry along, that motion
    takes the surface onto the goal; elsewhere it does not. A point knows how far it then is from
    the goal, its place, what lies around it (features of the three nearest centroids of both
    levels, weighed by inverse distance: feature propagation of PointNet++, Qi et al. 2017), and
    how the goal differs from the initial shape as a whole.
    """

    hidden = (128, 64)
    patch = 16
    """Nearest points over which the distances from the goal are averaged, too."""
    goal_points = 768
    """Points of the goal that distances are measured to, the first ones."""

    def __init__(self, config: DeformerNetConfig | None = None) -> None:
        super().__init__()
        self.guide = DeformerNet(config)
        self.config = self.guide.config
        first, second = self.hidden
        self.place = nn.Linear(3, first)
        self.carried = nn.Linear(5, first, bias=False)
        self.near = nn.Linear(Encoder.widths[0], first, bias=False)
        self.far = nn.Linear(Encoder.widths[1], first, bias=False)
        self.whole = nn.Linear(2 * Encoder.features, first, bias=False)
        norm = self.config.norm
        self.first_norm = make_norm(norm, first)
        self.second = nn.Linear(first, second)
        self.second_norm = make_norm(norm, second)
        self.output = nn.Linear(second, 1)

    def forward(
        self,
        initial: Neighbourhoods,
        goal: Neighbourhoods,
        of: Int64[Tensor, " p"],
        *,
        candidates: Float[Tensor, "b c 3"],
    ) -> Scored:
        """Return how likely each candidate is, and the motion that leads to the goal.

        Args:
            initial: A batch of clouds at rest.
            goal: A batch of p goals.
            of: Which of the initial clouds each goal belongs to.
            candidates: Points of the surface of each initial cloud, in the network's unit.
        """
        seen, there = self.guide.encoder.levels(initial), self.guide.encode(goal)
        here = seen.whole[of]
        motion = self.guide.motion(here, there)
        local = self.place(candidates - initial.points.mean(dim=1, keepdim=True))
        for layer, (places, features) in zip(
            (self.near, self.far), (seen.first, seen.second), strict=True
        ):
            # The layer commutes with the interpolation, and there are few centroids.
            local = local + propagate(candidates, places, layer(features))
        whole = self.whole(torch.cat([there - here, here], dim=1))
        way = motion.detach() / self.config.coordinate_unit
        carried = self.carried(self._distances(candidates, goal.points, of, way))
        hidden = functional.relu(self.first_norm(local[of] + whole[:, None] + carried))
        hidden = functional.relu(self.second_norm(self.second(hidden)))
        scores: Tensor = self.output(hidden)[..., 0]
        return Scored(functional.log_softmax(scores, dim=1), motion)

    @torch.no_grad()
    def _distances(
        self,
        points: Float[Tensor, "b n 3"],
        goal: Float[Tensor, "p m 3"],
        of: Int64[Tensor, " p"],
        motion: Float[Tensor, "p 3"],
    ) -> Float[Tensor, "p n 5"]:
        """Return how far each point, carried along, is from the goal, in centimetres.

        The offset to the nearest point of the goal, its length, and the mean length over the
        patch about the point.
        """
        goal = goal[:, : self.goal_points]
        moved = points[of] + motion[:, None]
        nearest = torch.cdist(moved, goal).argmin(dim=2)
        offsets = (gather(goal, nearest) - moved) * (self.config.coordinate_unit / 0.01)
        lengths = offsets.norm(dim=2, keepdim=True)
        size = min(self.patch, points.shape[1])
        patches = torch.cdist(points, points).topk(size, dim=2, largest=False).indices
        means = gather(lengths, patches[of])[..., 0].mean(dim=2, keepdim=True)
        return torch.cat([offsets, lengths, means], dim=2)

    @torch.no_grad()
    def choose(self, initial: Cloud, goal: Cloud) -> Chosen:
        """Return which point of the surface to grasp, and how likely each of them is.

        Raises:
            ShortCloud, LongCloud: If a cloud has not the number of points that the network takes.
            BadCloud: If a coordinate is NaN or infinite.
        """
        here, there = _prepared(initial, goal, self.config)
        candidates = surface(here, SCORED)
        scores = self(here, there, torch.zeros(1, dtype=torch.int64), candidates=candidates).scores
        places = torch.from_numpy(np.concatenate([initial[:SCORED], hidden_sides(initial)]))
        point = expected(scores, places)[0].numpy().astype(np.float64)
        return Chosen(point, places.numpy(), scores[0].exp().numpy())


def surface(clouds: Neighbourhoods, count: int | None = None) -> Float[Tensor, "b c 3"]:
    """Return points of the surface of each cloud: its first `count`, or all, and hidden sides."""
    sides = [torch.from_numpy(hidden_sides(points)) for points in clouds.points.cpu().numpy()]
    seen = clouds.points[:, :count]
    return torch.cat([seen, torch.stack(sides).to(seen)], dim=1)


def expected(
    scores: Float[Tensor, "p c"], candidates: Float[Tensor, "c 3"]
) -> Float[Tensor, "p 3"]:
    """Return the candidate nearest to the mean of the heat map, for each goal of one cloud.

    Args:
        scores: Logarithms of probabilities.
        candidates: In metres.
    """
    means = scores.exp() @ candidates
    nearest = torch.cdist(means, candidates, compute_mode="donot_use_mm_for_euclid_dist")
    return candidates[nearest.argmin(dim=1)]


def propagate(
    points: Float[Tensor, "b n 3"], places: Float[Tensor, "b s 3"], values: Float[Tensor, "b s c"]
) -> Float[Tensor, "b n c"]:
    """Return values at points, from the three places nearest to each."""
    distances = torch.cdist(points, places, compute_mode="donot_use_mm_for_euclid_dist")
    near, rows = distances.topk(3, dim=2, largest=False)
    weights = 1 / (near + 1e-6)
    weights = weights / weights.sum(dim=2, keepdim=True)
    return (gather(values, rows) * weights[..., None]).sum(dim=2)


def middle(clouds: Neighbourhoods, config: DeformerNetConfig) -> Float[Tensor, "b 3"]:
    """Return the mean of the points of each cloud, in metres."""
    return clouds.points.mean(dim=1) * config.coordinate_unit


def _prepared(
    initial: Cloud, goal: Cloud, config: DeformerNetConfig
) -> tuple[Neighbourhoods, Neighbourhoods]:
    centre = centroid(initial)
    here = prepare(initial, config, what="initial cloud", centre=centre)
    return stack([here]), stack([prepare(goal, config, what="goal cloud", centre=centre)])
