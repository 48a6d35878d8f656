"""A level of PointConv in a few passes over each cloud, on a processor.

The same function as `SetAbstraction` computes step by step, and its derivatives. What these need
again is made again: that is cheaper than to write it to memory and to read it.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Float32, Integer
from numba.core import config
from torch import Tensor
from torch.autograd.function import once_differentiable

from dnet.nets.cloud_threads import for_all_clouds
from dnet.nets.kernels.level import WEIGHTS, Derivatives, Level
from dnet.nets.kernels.matrix_product import COLUMNS, ROWS
from dnet.nets.kernels.norm import normalise, normalise_gradients
from dnet.nets.kernels.pointwise import BLOCK
from dnet.nets.kernels.set_abstraction import set_abstraction
from dnet.nets.kernels.set_abstraction_gradients import set_abstraction_gradients

# Clouds are done together as long as so many bytes go into their last layer: these stay in the
# cache until the matrix product reads them. But enough of them to keep several threads at work.
# The number of threads is no part of it, so that it changes no result.
_BYTES = 2**22
_CLOUDS = 8

_Widths = tuple[tuple[int, ...], tuple[int, ...]]

_wanted: ContextVar[bool] = ContextVar("wanted", default=True)


@contextmanager
def step_by_step() -> Iterator[None]:
    """Let every level be computed step by step while the context lasts."""
    token = _wanted.set(False)
    try:
        yield
    finally:
        _wanted.reset(token)


class Layers(NamedTuple):
    """The parameters of one level."""

    point_weight: Tensor
    point_bias: Tensor
    output_weight: Tensor
    output_bias: Tensor
    small: tuple[Tensor, ...]
    """The others: weights and biases of the first norm, of each linear map and norm of WeightNet
    and of DensityNet, and of the last norm."""
    weight_widths: tuple[int, ...]
    """Channels of WeightNet's input and layers."""
    density_widths: tuple[int, ...]
    """Channels of DensityNet's input and layers."""


def fused_level(
    points: Float[Tensor, "b n 3"],
    features: Float[Tensor, "b n d"],
    *,
    centroids: Float[Tensor, "b s 3"],
    neighbours: Integer[Tensor, "b s k"] | None,
    inverse_density: Float[Tensor, "b n"],
    layers: Layers,
) -> Float[Tensor, "b s c"] | None:
    """Return the features of the centroids, or None where they must be computed step by step.

    That is: on another device than the processor, in another precision than float32, while
    torch traces or compiles, for derivatives of the densities, and for odd sizes.

    Raises:
        IndexError: If a neighbour is no row of its cloud.
    """
    if torch.compiler.is_compiling() or not _wanted.get():
        return None
    if torch.jit.is_tracing():  # type: ignore[attr-defined,no-untyped-call]
        return None
    batch, count, _ = points.shape
    if neighbours is None:
        neighbours = torch.arange(count, dtype=torch.int16).expand(batch, 1, count)
    elif neighbours.dtype != torch.int16:
        # The kernels are compiled for one type. What is out of bounds stays so.
        rows = torch.int16 if count < 2**15 else torch.int32
        neighbours = neighbours.clamp(-1, count).to(rows)
    tables = (points, features, centroids, neighbours, inverse_density)
    if not _fits(tables, layers):
        return None
    *parameters, small, weight_widths, density_widths = layers
    widths = (weight_widths, density_widths)
    if not torch.is_grad_enabled():
        return _compute(tables, (*parameters, *small), widths)[0]
    apply: Callable[..., Tensor] = _FusedLevel.apply
    return apply(widths, *tables, *parameters, *small)


def _fits(tables: tuple[Tensor, ...], layers: Layers) -> bool:
    """Return whether the kernels take these tensors."""
    points, features, centroids, neighbours, inverse_density = tables
    numbers = (points, features, centroids, inverse_density, *layers[:4], *layers.small)
    # Subclasses stand for something else: for no numbers, or for those of several processors.
    if not set(map(type, (*numbers, neighbours))) <= {Tensor, torch.nn.Parameter}:
        return False
    if not all(x.is_cpu for x in (*numbers, neighbours)):
        return False
    if {x.dtype for x in numbers} != {torch.float32} or torch.is_autocast_enabled("cpu"):
        return False
    if inverse_density.requires_grad and torch.is_grad_enabled():
        return False
    if config.DISABLE_JIT:  # type: ignore[attr-defined]
        return False
    batch, count, known = features.shape
    _, groups, size = neighbours.shape
    channels = len(layers.point_bias)
    return (
        points.shape == (batch, count, 3)
        and centroids.shape == (batch, groups, 3)
        and neighbours.shape == (batch, groups, size)
        and inverse_density.shape == (batch, count)
        and layers.point_weight.shape == (channels, 3 + known)
        and layers.output_weight.shape == (channels, WEIGHTS * channels)
        and min(batch, count) > 0
        and channels % COLUMNS == 0
        and size % ROWS == 0
        and groups * size % BLOCK == 0
    )


def _compute(
    tables: tuple[Tensor, ...], parameters: tuple[Tensor, ...], widths: _Widths
) -> tuple[Float32[Tensor, "b s c"], Float32[Tensor, "b s c"], Float32[Tensor, "2 b 2"]]:
    """Return a level's output, what the last norm takes, and the figures of both norms."""
    arrays = [table.contiguous().numpy() for table in tables]
    weight, bias = parameters[2:4]
    batch, groups, channels = len(arrays[0]), arrays[2].shape[1], len(bias)
    linear, small, norm = _packed(parameters)
    mixed = bias.new_empty(batch, groups, channels)
    out = torch.empty_like(mixed)
    figures = bias.new_empty(2, batch, 2)
    hidden_figures, mixed_figures = figures.numpy()
    chunks = _chunks(batch, groups * channels)
    summed = bias.new_empty(chunks[0].stop, groups, channels * WEIGHTS)
    for chunk in chunks:
        level = _level(arrays, chunk, linear, small, widths)
        count = chunk.stop - chunk.start
        work = partial(set_abstraction, level, summed.numpy(), hidden_figures[chunk])
        if not all(for_all_clouds(work, count)):
            raise IndexError("a neighbour is no row of its cloud")
        part = mixed[chunk]
        torch.addmm(bias, summed[:count].flatten(0, 1), weight.t(), out=part.flatten(0, 1))
        numbers = (part.numpy(), norm, out[chunk].numpy(), mixed_figures[chunk])
        for_all_clouds(partial(normalise, *numbers), count)
    return out, mixed, figures


class _FusedLevel(torch.autograd.Function):
    """A level as one step of the graph of derivatives."""

    @staticmethod
    def forward(ctx: Any, widths: _Widths, *tensors: Tensor) -> Tensor:
        out, mixed, figures = _compute(tensors[:5], tensors[5:], widths)
        ctx.save_for_backward(mixed, figures, *tensors)
        ctx.widths = widths
        return out

    @staticmethod
    @once_differentiable
    def backward(  # pyright: ignore[reportIncompatibleMethodOverride]
        ctx: Any, gradient: Tensor
    ) -> tuple[Tensor | None, ...]:
        mixed, figures, *tables = ctx.saved_tensors[:7]
        parameters = ctx.saved_tensors[7:]
        arrays = [table.contiguous().numpy() for table in tables]
        point_weight, _, weight, _, *small_parameters = parameters
        batch, groups, channels = mixed.shape
        points = arrays[0].shape[1]
        linear, small, norm = _packed(parameters)
        hidden_figures, mixed_figures = figures.numpy()
        out_gradient = gradient.contiguous().numpy()
        to_points, to_features, to_centroids = ctx.needs_input_grad[1:4]
        # An empty batch of places for a gradient: it is not asked for.
        with_places = batch if to_points or to_centroids else 0
        with_hidden = batch if to_points or to_features else 0
        hidden_gradient = gradient.new_empty(with_hidden, points, channels)
        point_gradient = gradient.new_empty(with_places, points, 3)
        centroid_gradient = gradient.new_empty(with_places, groups, 3)
        linear_total, small_total = np.zeros_like(linear), np.zeros_like(small)
        norm_total = np.zeros((3, channels), np.float32)
        weight_total = torch.empty_like(weight)
        chunks = _chunks(batch, groups * channels)
        most = chunks[0].stop
        sum_gradient, summed = gradient.new_empty(2, most, groups, channels * WEIGHTS)
        mixed_gradient = gradient.new_empty(most, groups, channels)
        for chunk in chunks:
            count = chunk.stop - chunk.start
            of_mixed = mixed_gradient[:count].flatten(0, 1)
            norms = np.empty((count, 3, channels), np.float32)
            numbers = (mixed[chunk].numpy(), norm, mixed_figures[chunk], out_gradient[chunk])
            work = partial(normalise_gradients, *numbers, mixed_gradient.numpy(), norms)
            for_all_clouds(work, count)
            torch.mm(of_mixed, weight, out=sum_gradient[:count].flatten(0, 1))

            derivatives = Derivatives(
                np.empty((count, *linear.shape), np.float32),
                np.empty((count, len(small) - 2 * channels), np.float32),
                hidden_gradient[chunk].numpy(),
                point_gradient[chunk].numpy(),
                centroid_gradient[chunk].numpy(),
            )
            level = _level(arrays, chunk, linear, small, ctx.widths)
            numbers = (level, hidden_figures[chunk], sum_gradient.numpy(), summed.numpy())
            for_all_clouds(partial(set_abstraction_gradients, *numbers, derivatives), count)
            beta = 0 if chunk is chunks[0] else 1
            weight_total.addmm_(of_mixed.t(), summed[:count].flatten(0, 1), beta=beta)
            linear_total += derivatives.linear.sum(axis=0)
            small_total[: -2 * channels] += derivatives.parameters.sum(axis=0)
            norm_total += norms.sum(axis=0)

        if with_places:
            point_gradient += hidden_gradient @ point_weight[:, :3]
        small_total[-2 * channels :] = norm_total[:2].reshape(-1)
        sizes = [one.numel() for one in small_parameters]
        small_gradients = torch.split(torch.from_numpy(small_total), sizes)
        return (
            None,
            point_gradient if to_points else None,
            hidden_gradient @ point_weight[:, 3:] if to_features else None,
            centroid_gradient if to_centroids else None,
            None,
            None,
            torch.from_numpy(linear_total[: point_weight.shape[1]]).t(),
            torch.from_numpy(linear_total[point_weight.shape[1]]),
            weight_total,
            torch.from_numpy(norm_total[2]),
            *(x.view_as(one) for x, one in zip(small_gradients, small_parameters, strict=True)),
        )


def _level(
    arrays: Sequence[np.ndarray],
    chunk: slice,
    linear: Float32[np.ndarray, "inputs c"],
    small: Float32[np.ndarray, " _"],
    widths: _Widths,
) -> Level:
    """Return some clouds of a level."""
    points, features, centroids, neighbours, inverse_density = (one[chunk] for one in arrays)
    return Level(points, features, centroids, neighbours, inverse_density, linear, small, *widths)


def _packed(
    parameters: Sequence[Tensor],
) -> tuple[Float32[np.ndarray, "inputs c"], Float32[np.ndarray, " _"], Float32[np.ndarray, "2 c"]]:
    """Return the first layer, all small parameters, and those of the last norm among them.

    The first layer stands as its kernel takes it: inputs, then biases, in a multiple of 4 rows.
    """
    weight, bias, _, _, *small_parameters = (one.numpy() for one in parameters)
    channels, inputs = weight.shape
    linear = np.zeros(((inputs + 4) // 4 * 4, channels), np.float32)
    linear[:inputs] = weight.T
    linear[inputs] = bias
    small = np.concatenate(small_parameters, axis=None)
    return linear, small, small[-2 * channels :].reshape(2, channels)


def _chunks(batch: int, sums: int) -> list[slice]:
    """Return the clouds that are done together, each with so many rows of weighted sums."""
    most = min(batch, max(_CLOUDS, _BYTES // (4 * WEIGHTS * sums)))
    return [slice(first, min(first + most, batch)) for first in range(0, batch, most)]
