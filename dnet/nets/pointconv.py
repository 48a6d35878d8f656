"""Density-weighted set abstraction: a convolution over points (PointConv; Wu, Qi, Fuxin 2019).

The layers are those of the paper; the order of operations is chosen for a CPU. A linear layer
commutes with gathering, so it is applied to the points before they are gathered; channels lie
last, so that layers are plain matrix products; the two small networks on offsets and densities
have so few channels that theirs lie first instead, over one long row axis. What stands here step
by step runs in a few passes where `dnet.nets.fused` takes it.
"""

from itertools import pairwise
from typing import Literal

import torch
from jaxtyping import Float, Integer
from torch import Tensor, nn
from torch.nn import functional

from dnet.nets.batch_norm import batch_normalise, moments
from dnet.nets.fused import Layers, fused_level
from dnet.nets.kernels.norm import EPSILON

Norm = Literal["group", "batch"]
"""`group`: over all channels of one cloud; `batch`: each channel over all clouds of a batch."""


class GroupNorm(nn.Module):
    """GroupNorm(1, C) of activations with the batch first (Wu, He 2018)."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.ones(channels))
        self.bias = nn.Parameter(torch.zeros(channels))
        self.epsilon = EPSILON

    def forward(self, x: Float[Tensor, "b *rows c"]) -> Float[Tensor, "b *rows c"]:
        """Normalise with channels last."""
        planes = x.reshape(x.shape[0], -1, 1, x.shape[-1]).permute(0, 3, 1, 2)
        planes = functional.group_norm(planes, 1, self.weight, self.bias, self.epsilon)
        return planes.permute(0, 2, 3, 1).reshape(x.shape)

    def channels_first(self, x: Float[Tensor, "c b rows"]) -> Float[Tensor, "c b rows"]:
        """Normalise with channels before the batch."""
        count = x.shape[0] * x.shape[2]
        # Two small sums are faster than one over two axes that do not lie together.
        mean = x.sum(dim=2).sum(dim=0) / count
        centred = x - mean[:, None]
        variance = centred.square().sum(dim=2).sum(dim=0) / count
        scale = self.weight[:, None] * torch.rsqrt(variance + self.epsilon)
        return torch.addcmul(self.bias[:, None, None], centred, scale[..., None])


class BatchNorm(nn.Module):
    """Batch normalisation over every axis but the channels (Ioffe, Szegedy 2015)."""

    mean: Tensor
    variance: Tensor

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.ones(channels))
        self.bias = nn.Parameter(torch.zeros(channels))
        self.register_buffer("mean", torch.zeros(channels))
        self.register_buffer("variance", torch.ones(channels))
        self.momentum = 0.1
        self.epsilon = 1e-5

    def forward(self, x: Float[Tensor, "b *rows c"]) -> Float[Tensor, "b *rows c"]:
        """Normalise with channels last."""
        rows = x.reshape(-1, x.shape[-1])
        # The sums of a few rows are exact enough as PyTorch takes them, and faster.
        few = self.training and len(rows) < 256
        if x.is_cpu and x.dtype == self.weight.dtype and not few:
            return self._exactly(rows).view(x.shape)
        planes = self._normalise(x.reshape(1, -1, 1, x.shape[-1]).permute(0, 3, 1, 2))
        return planes.permute(0, 2, 3, 1).reshape(x.shape)

    def channels_first(self, x: Float[Tensor, "c b rows"]) -> Float[Tensor, "c b rows"]:
        """Normalise with channels before the batch."""
        if not self.training:
            # PyTorch scales before it takes the mean off, which costs digits.
            scale = self.weight / torch.sqrt(self.variance + self.epsilon)
            centred = x - self.mean[:, None, None]
            return torch.addcmul(self.bias[:, None, None], centred, scale[:, None, None])
        return self._normalise(x.reshape(1, len(x), -1)).reshape(x.shape)

    def _exactly(self, x: Float[Tensor, "rows c"]) -> Float[Tensor, "rows c"]:
        mean, variance = moments(x) if self.training else (self.mean, self.variance)
        if self.training:
            with torch.no_grad():
                self.mean.lerp_(mean, self.momentum)
                # Running figures are those of all data, of which the rows are a sample.
                self.variance.lerp_(variance * (len(x) / (len(x) - 1)), self.momentum)
        return batch_normalise(
            x,
            mean,
            torch.sqrt(variance + self.epsilon),
            weight=self.weight,
            bias=self.bias,
            tied=self.training,
        )

    def _normalise(self, x: Float[Tensor, "1 c *rows"]) -> Float[Tensor, "1 c *rows"]:
        return functional.batch_norm(
            x,
            self.mean,
            self.variance,
            self.weight,
            self.bias,
            self.training,
            self.momentum,
            self.epsilon,
        )


def make_norm(kind: Norm, channels: int) -> GroupNorm | BatchNorm:
    """Return a new normalisation of `kind`."""
    return GroupNorm(channels) if kind == "group" else BatchNorm(channels)


class PointwiseLayer(nn.Module):
    """Linear, norm and ReLU applied to every row alone, with few channels, which lie first."""

    def __init__(self, inputs: int, outputs: int, norm: Norm) -> None:
        super().__init__()
        self.linear = nn.Linear(inputs, outputs)
        self.norm = make_norm(norm, outputs)

    def forward(self, x: Float[Tensor, "c_in b rows"]) -> Float[Tensor, "c_out b rows"]:
        """Map the channels of each row."""
        _, batch, rows = x.shape
        linear = self.linear
        x = torch.addmm(linear.bias[:, None], linear.weight, x.reshape(len(x), -1))
        return functional.relu_(self.norm.channels_first(x.view(-1, batch, rows)))


def pointwise_net(widths: tuple[int, ...], norm: Norm) -> nn.Sequential:
    """Return WeightNet or DensityNet of PointConv: ReLU at each layer, the last one included."""
    return nn.Sequential(*(PointwiseLayer(a, b, norm) for a, b in pairwise(widths)))


class SetAbstraction(nn.Module):
    """One level: gather neighbours, weigh their features by place and density, and sum.

    Args:
        features: Channels of a point that comes in, its coordinates aside.
        channels: Channels of a centroid that goes out.
        norm: Normalisation of every layer.
        density: Whether to weigh by how crowded the points are, too.
    """

    weights_per_channel = 16
    weight_widths = (3, 8, 8, weights_per_channel)
    density_widths = (1, 16, 8, 1)

    def __init__(self, features: int, channels: int, norm: Norm, *, density: bool = True) -> None:
        super().__init__()
        self.point_linear = nn.Linear(3 + features, channels)
        self.point_norm = make_norm(norm, channels)
        self.weight_net = pointwise_net(self.weight_widths, norm)
        self.density_net = pointwise_net(self.density_widths, norm) if density else None
        self.output_linear = nn.Linear(self.weights_per_channel * channels, channels)
        self.output_norm = make_norm(norm, channels)

    def forward(
        self,
        points: Float[Tensor, "b n 3"],
        features: Float[Tensor, "b n d"],
        *,
        centroids: Float[Tensor, "b s 3"],
        neighbours: Integer[Tensor, "b s k"] | None,
        inverse_density: Float[Tensor, "b n"],
    ) -> Float[Tensor, "b s c"]:
        """Return the features of the centroids.

        Args:
            points: Coordinates.
            features: What is known of each point.
            centroids: Coordinates of the points to gather about.
            neighbours: Rows that each centroid gathers; None gathers all points about the only
                centroid.
            inverse_density: One over the density at each point.
        """
        if isinstance(self.point_norm, GroupNorm) and self.density_net is not None:
            fused = fused_level(
                points,
                features,
                centroids=centroids,
                neighbours=neighbours,
                inverse_density=inverse_density,
                layers=self._layers(self.density_net),
            )
            if fused is not None:
                return fused
        linear = self.point_linear
        hidden = functional.linear(
            torch.cat([points, features], dim=-1), linear.weight, linear.bias
        )
        if neighbours is None:
            hidden, offsets = hidden[:, None], points[:, None]
            scale = inverse_density[:, None]
        else:
            hidden, offsets = gather(hidden, neighbours), gather(points, neighbours)
            scale = gather(inverse_density[..., None], neighbours)[..., 0]
        # The first layer saw absolute coordinates; its part of the centroid comes off again.
        hidden = hidden - functional.linear(centroids, linear.weight[:, :3])[:, :, None]
        offsets = offsets - centroids[:, :, None]
        hidden = functional.relu_(self.point_norm(hidden))
        return self._convolve(hidden, offsets, scale=scale / scale.amax(dim=2, keepdim=True))

    def _layers(self, density_net: nn.Sequential) -> Layers:
        """Return the parameters as a fused level takes them."""
        point, output = self.point_linear, self.output_linear
        small: list[nn.Linear | GroupNorm | BatchNorm] = [self.point_norm]
        for layer in (*self.weight_net, *density_net):
            if isinstance(layer, PointwiseLayer):  # as all are
                small += [layer.linear, layer.norm]
        small.append(self.output_norm)
        return Layers(
            point.weight,
            point.bias,
            output.weight,
            output.bias,
            tuple(x for one in small for x in (one.weight, one.bias)),
            self.weight_widths,
            self.density_widths,
        )

    def _convolve(
        self,
        hidden: Float[Tensor, "b s k c"],
        offsets: Float[Tensor, "b s k 3"],
        *,
        scale: Float[Tensor, "b s k"],
    ) -> Float[Tensor, "b s c"]:
        """Weigh each neighbour's features by where it lies and how crowded, and sum."""
        batch, groups, size, channels = hidden.shape
        weights = self.weight_net(offsets.permute(3, 0, 1, 2).reshape(3, batch, -1))
        if self.density_net is not None:
            weights = weights * self.density_net(scale.reshape(1, batch, -1))
        weights = weights.view(-1, batch * groups, size).permute(1, 2, 0)
        hidden = hidden.view(batch * groups, size, channels).transpose(1, 2)
        summed = torch.bmm(hidden, weights).view(batch, groups, -1)
        return functional.relu_(self.output_norm(self.output_linear(summed)))


def gather(
    values: Float[Tensor, "b n c"], rows: Integer[Tensor, "b *rows"]
) -> Float[Tensor, "b *rows c"]:
    """Return the chosen rows of each cloud of a batch."""
    batch, points, channels = values.shape
    # Clouds laid end to end: one flat index is several times as fast as one with two axes.
    first = (torch.arange(batch, device=rows.device) * points).view(-1, *[1] * (rows.ndim - 1))
    flat = (rows.long() + first).reshape(-1)
    return values.reshape(-1, channels).index_select(0, flat).view(*rows.shape, channels)
