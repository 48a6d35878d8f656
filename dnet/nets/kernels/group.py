"""One group of neighbours: gathered, normalised, weighed and summed, and the way back, compiled."""

from typing import no_type_check

import numpy as np
from jaxtyping import Float32

from dnet.compiled import compiled_part
from dnet.nets.kernels.lanes import (
    LANES,
    add,
    at,
    load,
    multiply,
    multiply_add,
    spread,
    store,
    subtract,
    sum_of,
    transpose,
    where_positive,
)
from dnet.nets.kernels.level import WEIGHTS, Gradients, Level, Workspace
from dnet.nets.kernels.matrix_product import matrix_product
from dnet.nets.kernels.norm import moments


@compiled_part
@no_type_check
def find_origin(work: Workspace, level: Level, cloud: int, centroid: int, mean: float) -> None:
    """Write what the first layer makes of a centroid's coordinates, plus `mean`."""
    x = spread(level.centroids[cloud, centroid, 0])
    y = spread(level.centroids[cloud, centroid, 1])
    z = spread(level.centroids[cloud, centroid, 2])
    channels = len(work.origin)
    for channel in range(0, channels, LANES):
        value = multiply_add(x, load(level.linear, channel), spread(mean))
        value = multiply_add(y, load(level.linear, channels + channel), value)
        value = multiply_add(z, load(level.linear, 2 * channels + channel), value)
        store(work.origin, channel, value)


@compiled_part
@no_type_check
def find_moments(work: Workspace, level: Level, cloud: int) -> None:
    """Write mean and one over the standard deviation of all gathered values."""
    groups, size = level.neighbours.shape[1:]
    channels = work.hidden.shape[1]
    pivot = np.float32(0)
    total, square = 0.0, 0.0
    for centroid in range(groups):
        find_origin(work, level, cloud, centroid, pivot)
        if centroid == 0:
            pivot = work.hidden[level.neighbours[cloud, 0, 0], 0] - work.origin[0]
            find_origin(work, level, cloud, centroid, pivot)
        zero = spread(np.float32(0))
        left, right, left_square, right_square = zero, zero, zero, zero
        for member in range(size):
            row = np.int64(level.neighbours[cloud, centroid, member]) * channels
            for channel in range(0, channels, 2 * LANES):
                value = load(work.hidden, row + channel)
                value = subtract(value, load(work.origin, channel))
                left = add(left, value)
                left_square = multiply_add(value, value, left_square)
                value = load(work.hidden, row + channel + LANES)
                value = subtract(value, load(work.origin, channel + LANES))
                right = add(right, value)
                right_square = multiply_add(value, value, right_square)
        total += sum_of(add(left, right))
        square += sum_of(add(left_square, right_square))
    count = groups * size * channels
    work.figure[0], work.figure[1] = moments(pivot, total, square, count)


@compiled_part
@no_type_check
def gather_group(work: Workspace, level: Level, cloud: int, centroid: int) -> None:
    """Write places, origin and members of a group, normalised and after ReLU."""
    size, channels = work.group.shape
    find_origin(work, level, cloud, centroid, work.figure[0])
    for member in range(size):
        work.places[member] = np.int64(level.neighbours[cloud, centroid, member]) * channels
    scale = spread(work.figure[1])
    for channel in range(0, channels, LANES):
        factor = multiply(load(level.parameters, channel), scale)
        bias = load(level.parameters, channels + channel)
        origin = load(work.origin, channel)
        for member in range(size):
            value = subtract(load(work.hidden, work.places[member] + channel), origin)
            value = multiply_add(value, factor, bias)
            store(work.group, member * channels + channel, where_positive(value, value))


@compiled_part
@no_type_check
def sum_group(
    work: Workspace, summed: Float32[np.ndarray, "b s 16c"], cloud: int, centroid: int
) -> None:
    """Write the sums of a group at each of the weights, a row of weights for each channel."""
    size, channels = work.group.shape
    wide = np.int64(WEIGHTS)  # as any other number, or the product would be compiled for it
    sums = at(summed, (cloud * summed.shape[1] + centroid) * channels * WEIGHTS)
    weights = at(work.weights, centroid * size * WEIGHTS)
    shape = (channels, size, wide)
    matrix_product(sums, wide, at(work.group, 0), 1, channels, weights, wide, shape)


@compiled_part
@no_type_check
def sum_group_gradients(
    work: Workspace,
    gradients: Gradients,
    gradient: Float32[np.ndarray, "b s 16c"],
    cloud: int,
    centroid: int,
) -> None:
    """Take the gradient of the sums to the members of the group and to their weights."""
    size, channels = work.group.shape
    wide = np.int64(WEIGHTS)
    sums = at(gradient, (cloud * gradient.shape[1] + centroid) * channels * WEIGHTS)
    begin = centroid * size * WEIGHTS
    to_weights = at(gradients.weights, begin)
    shape = (size, channels, wide)
    matrix_product(to_weights, wide, at(work.group, 0), channels, 1, sums, wide, shape)
    for channel in range(0, channels, LANES):
        for weight in range(0, WEIGHTS, LANES):
            target = at(gradients.turned, weight * channels + channel)
            transpose(target, channels, at(sums, channel * WEIGHTS + weight), WEIGHTS)
    to_group, weights = at(gradients.group, 0), at(work.weights, begin)
    turned, shape = at(gradients.turned, 0), (size, wide, channels)
    matrix_product(to_group, channels, weights, wide, 1, turned, channels, shape)


@compiled_part
@no_type_check
def scatter_group(
    work: Workspace,
    gradients: Gradients,
    own: Float32[np.ndarray, " _"],
    centroid: int,
) -> None:
    """Take the gradient of a group through ReLU and add it up, by point and by channel.

    Args:
        work: Holds the group.
        gradients: Hold that of the group; receive the sums by point, and over the group.
        own: Of the norm's weights (before their scale) and biases, summed over the cloud.
        centroid: The group's.
    """
    size, channels = work.group.shape
    for channel in range(0, channels, LANES):
        origin = load(work.origin, channel)
        zero = spread(np.float32(0))
        total, product, slope = zero, zero, zero
        for member in range(size):
            target = work.places[member] + channel
            place = member * channels + channel
            part = where_positive(load(work.group, place), load(gradients.group, place))
            value = subtract(load(work.hidden, target), origin)
            store(gradients.hidden, target, add(load(gradients.hidden, target), part))
            total = add(total, part)
            product = multiply_add(part, value, product)
            slope = add(slope, value)
        store(gradients.sums, centroid * channels + channel, total)
        store(gradients.slopes, centroid * channels + channel, slope)
        store(own, channel, add(load(own, channel), product))
        store(own, channels + channel, add(load(own, channels + channel), total))
