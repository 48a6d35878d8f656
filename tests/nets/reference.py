"""DeformerNet written plainly from the equations, over the weights of a `DeformerNet`.

Every group is built before any layer sees it, neighbours come from a sorted matrix of distances,
norms are their definitions, and no two steps are merged.
"""

import torch
from torch import Tensor, nn

from dnet.nets.deformernet import DeformerNet
from dnet.nets.neighbourhoods import BANDWIDTHS, GROUPINGS, Size
from dnet.nets.pointconv import BatchNorm, GroupNorm, PointwiseLayer, SetAbstraction


def normalise(x: Tensor, norm: GroupNorm | BatchNorm) -> Tensor:
    """Channels last, the batch first."""
    over = tuple(range(1, x.ndim)) if isinstance(norm, GroupNorm) else tuple(range(x.ndim - 1))
    if isinstance(norm, BatchNorm) and not norm.training:
        mean, variance = norm.mean, norm.variance
    else:
        mean = x.mean(over, keepdim=True)
        variance = x.var(over, correction=0, keepdim=True)
    return (x - mean) / torch.sqrt(variance + norm.epsilon) * norm.weight + norm.bias


def layer(x: Tensor, linear: nn.Linear, norm: GroupNorm | BatchNorm) -> Tensor:
    product = torch.einsum("oi,...i->...o", linear.weight, x) + linear.bias
    return torch.relu(normalise(product, norm))


def small_net(x: Tensor, net: nn.Sequential) -> Tensor:
    for one in net.children():
        assert isinstance(one, PointwiseLayer)
        x = layer(x, one.linear, one.norm)
    return x


def inverse_density(points: Tensor, bandwidth: float) -> Tensor:
    exact = "donot_use_mm_for_euclid_dist"
    squares = torch.cdist(points, points, compute_mode=exact).square()
    return 1 / (torch.exp(-squares / (2 * bandwidth**2)) / (2.5 * bandwidth)).mean(-1)


def pick(values: Tensor, rows: Tensor) -> Tensor:
    return torch.stack([one[chosen] for one, chosen in zip(values, rows, strict=True)])


def abstract(
    level: SetAbstraction,
    points: Tensor,
    features: Tensor,
    bandwidth: float,
    grouping: tuple[int, int] | None,
) -> tuple[Tensor, Tensor]:
    density = inverse_density(points, bandwidth)
    if grouping is None:
        centroids = points.mean(1, keepdim=True)
        rows = torch.arange(points.shape[1]).expand(len(points), 1, -1)
    else:
        count, neighbours = grouping
        centroids = points[:, :count]
        rows = torch.cdist(centroids, points).argsort(-1)[..., :neighbours]
    offsets = pick(points, rows) - centroids[:, :, None]
    scale = pick(density, rows)
    scale = (scale / scale.max(-1, keepdim=True).values)[..., None]
    hidden = torch.cat([offsets, pick(features, rows)], -1)
    hidden = layer(hidden, level.point_linear, level.point_norm)
    if level.density_net is not None:
        hidden = hidden * small_net(scale, level.density_net)
    weights = small_net(offsets, level.weight_net)
    summed = torch.einsum("bskc,bskw->bscw", hidden, weights).flatten(2)
    return centroids, layer(summed, level.output_linear, level.output_norm)


def farthest(points: Tensor, count: int) -> Tensor:
    """Rows of each cloud, each the farthest from those before it, the first one first."""
    chosen = torch.zeros(len(points), count, dtype=torch.long)
    nearest = torch.full(points.shape[:2], torch.inf)
    clouds = torch.arange(len(points))
    for place in range(1, count):
        newest = points[clouds, chosen[:, place - 1]]
        nearest = torch.minimum(nearest, (points - newest[:, None]).square().sum(-1))
        chosen[:, place] = nearest.argmax(-1)
    return chosen


def sampled(points: Tensor, size: Size) -> Tensor:
    """Clouds whose first points are the centroids of both levels, sampled as each level would."""
    first, second = GROUPINGS[size]
    rows = farthest(points, first.centroids)
    centroids = pick(points, rows)
    above = farthest(centroids, second.centroids)
    # The farthest of the farthest are their first ones; nothing moves, but both were looked for.
    assert torch.equal(above, torch.arange(second.centroids).expand_as(above))
    left = torch.ones(points.shape[:2], dtype=torch.bool).scatter_(1, rows, value=False)
    others = left.nonzero()[:, 1].view(len(points), -1)
    return pick(points, torch.cat([rows, others], 1))


def encode(model: DeformerNet, points: Tensor) -> Tensor:
    first, second = GROUPINGS[model.config.size]
    encoder = model.encoder
    features = points
    for level, bandwidth, grouping in (
        (encoder.first, BANDWIDTHS[0], (first.centroids, first.neighbours)),
        (encoder.second, BANDWIDTHS[1], (second.centroids, second.neighbours)),
        (encoder.third, BANDWIDTHS[2], None),
    ):
        points, features = abstract(level, points, features, bandwidth, grouping)
    return features[:, 0]


def motion(model: DeformerNet, current: Tensor, goal: Tensor) -> Tensor:
    """From clouds in the network's unit to motions in metres."""
    hidden = encode(model, goal) - encode(model, current)
    children = list(model.head.hidden.children())
    for linear, norm in zip(children[::3], children[1::3], strict=True):
        assert isinstance(linear, nn.Linear)
        assert isinstance(norm, GroupNorm | BatchNorm)
        hidden = layer(hidden, linear, norm)
    output = torch.einsum("oi,pi->po", model.head.output.weight, hidden) + model.head.output.bias
    return output * model.config.motion_unit
