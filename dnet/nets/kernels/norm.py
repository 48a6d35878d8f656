"""GroupNorm(1, C) and ReLU of a few clouds with channels last, and their derivatives, compiled."""

from typing import no_type_check

import numpy as np
from jaxtyping import Float32

from dnet.compiled import compiled, compiled_part
from dnet.nets.kernels.lanes import (
    LANES,
    add,
    load,
    multiply,
    multiply_add,
    spread,
    store,
    subtract,
    sum_of,
    where_positive,
)

EPSILON = 1e-5
"""Of the norms."""


@compiled_part
@no_type_check
def moments(pivot: float, total: float, square: float, count: int) -> tuple[float, float]:
    """Return the mean and one over the standard deviation.

    Args:
        pivot: A value among the others, so that sums of distances from it hardly cancel.
        total: Sum of the distances from it.
        square: Sum of their squares.
        count: How many values there are.
    """
    away = total / count
    variance = max(square / count - away * away, 0.0)
    return np.float32(pivot + away), np.float32(1 / np.sqrt(variance + EPSILON))


@compiled(without_gil=True)
@no_type_check
def normalise(
    x: Float32[np.ndarray, "b rows c"],
    norm: Float32[np.ndarray, "2 c"],
    out: Float32[np.ndarray, "b rows c"],
    figures: Float32[np.ndarray, "b 2"],
    first: int,
    last: int,
) -> None:
    """Normalise clouds `first` to `last` and apply ReLU.

    Args:
        x: What goes in.
        norm: Weights and biases of the norm.
        out: Receives what comes out.
        figures: Receives mean and one over the standard deviation of each cloud.
        first: Cloud to begin with.
        last: Cloud to stop before.
    """
    rows, channels = x.shape[1:]
    for cloud in range(first, last):
        pivot = x[cloud, 0, 0]
        middle = spread(pivot)
        total, square = 0.0, 0.0
        for row in range(rows):
            begin = (cloud * rows + row) * channels
            part, part_square = spread(np.float32(0)), spread(np.float32(0))
            for channel in range(0, channels, LANES):
                value = subtract(load(x, begin + channel), middle)
                part = add(part, value)
                part_square = multiply_add(value, value, part_square)
            total += sum_of(part)
            square += sum_of(part_square)
        mean, scale = moments(pivot, total, square, rows * channels)
        figures[cloud, 0], figures[cloud, 1] = mean, scale
        middle = spread(mean)
        for channel in range(0, channels, LANES):
            factor = multiply(load(norm, channel), spread(scale))
            bias = load(norm, channels + channel)
            for row in range(rows):
                place = (cloud * rows + row) * channels + channel
                value = multiply_add(subtract(load(x, place), middle), factor, bias)
                store(out, place, where_positive(value, value))


@compiled(without_gil=True)
@no_type_check
def normalise_gradients(
    x: Float32[np.ndarray, "b rows c"],
    norm: Float32[np.ndarray, "2 c"],
    figures: Float32[np.ndarray, "b 2"],
    gradient: Float32[np.ndarray, "b rows c"],
    x_gradient: Float32[np.ndarray, "b rows c"],
    own: Float32[np.ndarray, "b 3 c"],
    first: int,
    last: int,
) -> None:
    """Compute the derivatives of `normalise` for clouds `first` to `last`.

    Args:
        x: As there.
        norm: As there.
        figures: From there.
        gradient: With respect to what came out.
        x_gradient: Receives that of what goes in.
        own: Receives those of the norm's weights and biases, and of biases added to `x`.
        first: Cloud to begin with.
        last: Cloud to stop before.
    """
    rows, channels = x.shape[1:]
    for cloud in range(first, last):
        scale = figures[cloud, 1]
        middle, spread_scale = spread(figures[cloud, 0]), spread(scale)
        mean_part, slope_part = 0.0, 0.0
        for channel in range(0, channels, LANES):
            weight = load(norm, channel)
            factor = multiply(weight, spread_scale)
            bias = load(norm, channels + channel)
            total, slope = spread(np.float32(0)), spread(np.float32(0))
            for row in range(rows):
                place = (cloud * rows + row) * channels + channel
                centred = subtract(load(x, place), middle)
                part = where_positive(multiply_add(centred, factor, bias), load(gradient, place))
                store(x_gradient, place, part)
                total = add(total, part)
                slope = multiply_add(part, centred, slope)
            slope = multiply(slope, spread_scale)
            target = 3 * cloud * channels + channel
            store(own, target, slope)
            store(own, target + channels, total)
            mean_part += sum_of(multiply(weight, total))
            slope_part += sum_of(multiply(weight, slope))
        count = rows * channels
        shift = spread(np.float32(-mean_part / count * scale))
        tilt = spread(np.float32(-slope_part / count * scale * scale))
        for channel in range(0, channels, LANES):
            factor = multiply(load(norm, channel), spread_scale)
            total = spread(np.float32(0))
            for row in range(rows):
                place = (cloud * rows + row) * channels + channel
                change = multiply_add(subtract(load(x, place), middle), tilt, shift)
                change = multiply_add(load(x_gradient, place), factor, change)
                store(x_gradient, place, change)
                total = add(total, change)
            store(own, (3 * cloud + 2) * channels + channel, total)
