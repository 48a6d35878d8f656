"""WeightNet and DensityNet of PointConv on one cloud, and their derivatives, compiled.

Channels come first, over the long axis of the cloud's rows. What each layer's norm takes is kept;
what comes out of it is made again, block by block, where it is needed.
"""

from typing import NamedTuple, no_type_check

import numpy as np
from jaxtyping import Float32, Float64

from dnet.compiled import compiled_part
from dnet.nets.kernels.lanes import (
    LANES,
    Lanes,
    add,
    load,
    multiply,
    multiply_add,
    spread,
    spread_from,
    store,
    subtract,
    sum_of,
    where_positive,
)
from dnet.nets.kernels.norm import EPSILON

BLOCK = 4 * LANES
"""Rows that are worked on at once; the rows of a cloud must be a multiple."""


class Network(NamedTuple):
    """A small network on the rows of one cloud."""

    widths: tuple[int, ...]
    """Channels of the input and of each layer."""
    begin: int
    """Where its parameters begin among all: for each layer the weights and the biases of the
    linear map, then those of the norm."""
    values: Float32[np.ndarray, "channels rows"]
    """The network's input, then what the norm of each layer takes."""
    figures: Float32[np.ndarray, "layers 3"]
    """Mean, one over the standard deviation, and what the mean lost when it was rounded, at the
    norm of each layer."""


class Side(NamedTuple):
    """The gradient of what a norm of a network puts out."""

    gradient: Float32[np.ndarray, "widest rows"]
    sums: Float64[np.ndarray, "widest 2"]
    """For each channel the sum of it, and that of its products with what the norm takes less the
    mean. Small differences of these matter, hence the precision."""


@compiled_part
@no_type_check
def parameter_count(widths: tuple[int, ...]) -> int:
    """Return how many parameters a network of these widths has."""
    count = 0
    for layer in range(len(widths) - 1):
        count += widths[layer + 1] * (widths[layer] + 3)
    return count


@compiled_part
@no_type_check
def input_block(
    block: Float32[np.ndarray, "_"],
    values: Float32[np.ndarray, "channels rows"],
    first: int,
    channels: int,
    row: int,
) -> None:
    """Write a block of the network's input."""
    rows = values.shape[1]
    for channel in range(channels):
        for lane in range(0, BLOCK, LANES):
            value = load(values, (first + channel) * rows + row + lane)
            store(block, channel * BLOCK + lane, value)


@compiled_part
@no_type_check
def activated_block(
    block: Float32[np.ndarray, "_"],
    values: Float32[np.ndarray, "channels rows"],
    first: int,
    channels: int,
    row: int,
    parameters: Float32[np.ndarray, "_"],
    norm: int,
    figure: Float32[np.ndarray, "3"],
) -> None:
    """Write a block of what comes out of a layer's norm and ReLU.

    Args:
        block: Receives it, `BLOCK` rows a channel.
        values: Holds what the norm takes, from channel `first` on.
        first: See `values`.
        channels: Of the layer.
        row: Where the block begins.
        parameters: Hold the norm's weights from `norm` on, and its biases after them.
        norm: See `parameters`.
        figure: Of the norm, see `Network`.
    """
    rows = values.shape[1]
    middle = spread(figure[0])
    for channel in range(channels):
        factor = spread(parameters[norm + channel] * figure[1])
        bias = spread_from(parameters, norm + channels + channel)
        for lane in range(0, BLOCK, LANES):
            centred = subtract(load(values, (first + channel) * rows + row + lane), middle)
            value = multiply_add(centred, factor, bias)
            store(block, channel * BLOCK + lane, where_positive(value, value))


@compiled_part
@no_type_check
def moments_of_channels(
    pivots: Float32[np.ndarray, "_"],
    sums: Float32[np.ndarray, "_"],
    squares: Float32[np.ndarray, "_"],
    channels: int,
    rows: int,
) -> tuple[float, float]:
    """Return the mean and one over the standard deviation of all channels, in full precision.

    Args:
        pivots: A value near those of each channel: sums about it hardly cancel.
        sums: Of the distances from it, eight parts a channel.
        squares: Sums of their squares, likewise.
        channels: How many there are.
        rows: Values of a channel.
    """
    count = np.float64(channels * rows)
    mean = 0.0
    for channel in range(channels):
        part = np.float64(sum_of(load(sums, channel * LANES)))
        mean += rows * np.float64(pivots[channel]) + part
    mean /= count
    variance = 0.0
    for channel in range(channels):
        away = pivots[channel] - mean
        part = np.float64(sum_of(load(sums, channel * LANES)))
        square = np.float64(sum_of(load(squares, channel * LANES)))
        variance += square + 2 * away * part + rows * away * away
    variance = max(variance / count, 0.0)
    return mean, 1 / np.sqrt(variance + EPSILON)


@compiled_part
@no_type_check
def run_network(network: Network, parameters: Float32[np.ndarray, "_"]) -> None:
    """Compute values and figures of a network whose input is there."""
    widths, place, values, figures = network
    rows = values.shape[1]
    widest = max(widths)
    block = np.empty(widest * BLOCK, np.float32)
    pivots = np.empty(widest, np.float32)
    sums = np.empty(widest * LANES, np.float32)
    squares = np.empty(widest * LANES, np.float32)
    first = np.int64(0)
    for layer in range(len(widths) - 1):
        inputs, outputs = widths[layer], widths[layer + 1]
        biases = place + outputs * inputs
        above = first + inputs
        sums[:] = 0
        squares[:] = 0
        for row in range(0, rows, BLOCK):
            if layer == 0:
                input_block(block, values, first, inputs, row)
            else:
                norm = place - 2 * inputs
                figure = figures[layer - 1]
                activated_block(block, values, first, inputs, row, parameters, norm, figure)
            for channel in range(outputs):
                bias = spread_from(parameters, biases + channel)
                y0, y1, y2, y3 = bias, bias, bias, bias
                for number in range(inputs):
                    factor = spread_from(parameters, place + channel * inputs + number)
                    source = number * BLOCK
                    y0 = multiply_add(factor, load(block, source), y0)
                    y1 = multiply_add(factor, load(block, source + LANES), y1)
                    y2 = multiply_add(factor, load(block, source + 2 * LANES), y2)
                    y3 = multiply_add(factor, load(block, source + 3 * LANES), y3)
                target = (above + channel) * rows + row
                store(values, target, y0)
                store(values, target + LANES, y1)
                store(values, target + 2 * LANES, y2)
                store(values, target + 3 * LANES, y3)
                if row == 0:
                    pivots[channel] = values[above + channel, 0]
                pivot = spread_from(pivots, channel)
                y0, y1 = subtract(y0, pivot), subtract(y1, pivot)
                y2, y3 = subtract(y2, pivot), subtract(y3, pivot)
                total = add(load(sums, channel * LANES), add(add(y0, y1), add(y2, y3)))
                store(sums, channel * LANES, total)
                total = multiply_add(y0, y0, multiply(y1, y1))
                total = add(total, multiply_add(y2, y2, multiply(y3, y3)))
                store(squares, channel * LANES, add(load(squares, channel * LANES), total))
        mean, scale = moments_of_channels(pivots, sums, squares, outputs, rows)
        figures[layer, 0], figures[layer, 1] = mean, scale
        figures[layer, 2] = mean - figures[layer, 0]
        first = above
        place = biases + 3 * outputs


@compiled_part
@no_type_check
def output_block(
    block: Float32[np.ndarray, "_"],
    network: Network,
    parameters: Float32[np.ndarray, "_"],
    row: int,
) -> None:
    """Write a block of a network's output."""
    widths, begin, values, figures = network
    outputs = widths[-1]
    norm = begin + parameter_count(widths) - 2 * outputs
    first = len(values) - outputs
    figure = figures[len(figures) - 1]
    activated_block(block, values, first, outputs, row, parameters, norm, figure)


@compiled_part
@no_type_check
def network_gradients(
    network: Network,
    parameters: Float32[np.ndarray, "_"],
    side: Side,
    spare: Float32[np.ndarray, "widest rows"],
    derivatives: Float32[np.ndarray, "_"],
    down_to_input: bool,
) -> Float32[np.ndarray, "widest rows"]:
    """Compute the derivatives with respect to all parameters, and perhaps to the input.

    Args:
        network: After `run_network`.
        parameters: Its parameters, among others.
        side: Of the last layer's norm, in its first channels; it is worked in.
        spare: Like the gradient there. One of the two comes back with the input's gradient.
        derivatives: Receives those of the parameters, at the same places.
        down_to_input: Whether the input's gradient is wanted.
    """
    widths, begin, values, figures = network
    gradient, sums = side
    rows = values.shape[1]
    widest = max(widths)
    block = np.empty(widest * BLOCK, np.float32)
    change = np.empty(widest * BLOCK, np.float32)
    products = np.empty((widest + 1) * widest * LANES, np.float32)
    above = len(values)
    place = begin + parameter_count(widths)
    for layer in range(len(widths) - 2, -1, -1):
        inputs, outputs = widths[layer], widths[layer + 1]
        norm = place - 2 * outputs
        biases = norm - outputs
        place = biases - outputs * inputs
        above -= outputs
        first = above - inputs
        figure = figures[layer]
        shift, tilt = ties(sums, parameters, derivatives, norm, outputs, outputs * rows, figure)
        products[: (inputs + 1) * outputs * LANES] = 0
        sums[:inputs] = 0
        for row in range(0, rows, BLOCK):
            if layer == 0:
                input_block(block, values, first, inputs, row)
            else:
                below = figures[layer - 1]
                norm_below = place - 2 * inputs
                activated_block(block, values, first, inputs, row, parameters, norm_below, below)
            for channel in range(outputs):
                # Through the norm, whose values are tied to each other by their two sums.
                factor = spread(parameters[norm + channel] * figure[1])
                for lane in range(0, BLOCK, LANES):
                    centred = load(values, (above + channel) * rows + row + lane)
                    part = multiply_add(subtract(centred, spread(figure[0])), tilt, shift)
                    part = multiply_add(load(gradient, channel * rows + row + lane), factor, part)
                    store(change, channel * BLOCK + lane, part)
            add_products(products, change, block, inputs, outputs)
            if layer > 0 or down_to_input:
                transposed_linear(spare, row, change, parameters, place, (inputs, outputs))
            if layer > 0:
                middle = spread(figures[layer - 1, 0])
                for number in range(inputs):
                    target, source = number * rows + row, (first + number) * rows + row
                    total, slope = spread(np.float32(0)), spread(np.float32(0))
                    for lane in range(0, BLOCK, LANES):
                        part = load(spare, target + lane)
                        part = where_positive(load(block, number * BLOCK + lane), part)
                        store(spare, target + lane, part)
                        centred = subtract(load(values, source + lane), middle)
                        total, slope = add(total, part), multiply_add(part, centred, slope)
                    add_up(sums, number, total, slope)
        for channel in range(outputs):
            product = channel * (inputs + 1) * LANES
            derivatives[biases + channel] = sum_of(load(products, product))
            for number in range(inputs):
                product += LANES
                target = place + channel * inputs + number
                derivatives[target] = sum_of(load(products, product))
        gradient, spare = spare, gradient
    return gradient


@compiled_part
@no_type_check
def ties(
    sums: Float64[np.ndarray, "widest 2"],
    parameters: Float32[np.ndarray, "_"],
    derivatives: Float32[np.ndarray, "_"],
    norm: int,
    channels: int,
    count: int,
    figure: Float32[np.ndarray, "3"],
) -> tuple[Lanes, Lanes]:
    """Write the derivatives of a norm's parameters; return what its mean and its scale pass on.

    Args:
        sums: Of the norm, see `Side`.
        parameters: Hold the norm's weights from `norm` on, and its biases after them.
        derivatives: Receives theirs at the same places.
        norm: See `parameters`.
        channels: How many there are.
        count: How many values it normalised.
        figure: Of the norm, see `Network`.

    Returns:
        What each value gets, and what it gets for each unit above the mean.
    """
    scale, rest = figure[1], np.float64(figure[2])
    mean_part, slope_part = 0.0, 0.0
    for channel in range(channels):
        total = sums[channel, 0]
        slope = sums[channel, 1] - rest * total
        derivatives[norm + channel] = slope * scale
        derivatives[norm + channels + channel] = total
        # Rounded as where it is applied, so that what is passed on adds up to zero.
        factor = np.float32(parameters[norm + channel] * scale)
        mean_part += factor * total
        slope_part += factor * slope
    tilt = np.float32(-slope_part / count * scale * scale)
    shift = np.float32(-mean_part / count - tilt * rest)
    return spread(shift), spread(tilt)


@compiled_part
@no_type_check
def add_products(
    products: Float32[np.ndarray, "_"],
    change: Float32[np.ndarray, "_"],
    block: Float32[np.ndarray, "_"],
    inputs: int,
    outputs: int,
) -> None:
    """Add what a block gives to the gradients of a linear layer's biases and weights.

    Args:
        products: For each output that of its bias and of its weights, in eight parts each.
        change: The gradient of the outputs.
        block: The inputs.
        inputs: How many there are.
        outputs: How many there are.
    """
    for channel in range(outputs):
        source = channel * BLOCK
        x0, x1 = load(change, source), load(change, source + LANES)
        x2, x3 = load(change, source + 2 * LANES), load(change, source + 3 * LANES)
        product = channel * (inputs + 1) * LANES
        total = add(add(x0, x1), add(x2, x3))
        store(products, product, add(load(products, product), total))
        for number in range(inputs):
            product += LANES
            source = number * BLOCK
            total = multiply_add(x0, load(block, source), load(products, product))
            other = multiply(x1, load(block, source + LANES))
            total = multiply_add(x2, load(block, source + 2 * LANES), total)
            other = multiply_add(x3, load(block, source + 3 * LANES), other)
            store(products, product, add(total, other))


@compiled_part
@no_type_check
def transposed_linear(
    out: Float32[np.ndarray, "widest rows"],
    row: int,
    change: Float32[np.ndarray, "_"],
    parameters: Float32[np.ndarray, "_"],
    place: int,
    shape: tuple[int, int],
) -> None:
    """Write the gradient of a linear layer's inputs.

    Args:
        out: Receives it, from `row` on.
        row: Where the block begins.
        change: The gradient of its outputs.
        parameters: Hold its weights from `place` on.
        place: See `parameters`.
        shape: How many inputs and outputs there are.
    """
    inputs, outputs = shape
    rows = out.shape[1]
    for number in range(inputs):
        zero = spread(np.float32(0))
        x0, x1, x2, x3 = zero, zero, zero, zero
        for channel in range(outputs):
            factor = spread_from(parameters, place + channel * inputs + number)
            source = channel * BLOCK
            x0 = multiply_add(factor, load(change, source), x0)
            x1 = multiply_add(factor, load(change, source + LANES), x1)
            x2 = multiply_add(factor, load(change, source + 2 * LANES), x2)
            x3 = multiply_add(factor, load(change, source + 3 * LANES), x3)
        target = number * rows + row
        store(out, target, x0)
        store(out, target + LANES, x1)
        store(out, target + 2 * LANES, x2)
        store(out, target + 3 * LANES, x3)


@compiled_part
@no_type_check
def add_up(sums: Float64[np.ndarray, "widest 2"], channel: int, total: Lanes, slope: Lanes) -> None:
    """Add to the two sums of a channel, see `Side`."""
    sums[channel, 0] += sum_of(total)
    sums[channel, 1] += sum_of(slope)
