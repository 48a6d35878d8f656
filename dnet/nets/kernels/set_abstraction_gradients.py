"""The derivatives of set abstraction of a few clouds, compiled.

As in `set_abstraction`, one cloud is done after the other and each group is gathered once more.
The derivatives of parameters come for each cloud by itself.
"""

from typing import no_type_check

import numpy as np
from jaxtyping import Float32

from dnet.compiled import compiled, compiled_part
from dnet.nets.kernels.group import gather_group, scatter_group, sum_group, sum_group_gradients
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
    transpose,
    where_positive,
)
from dnet.nets.kernels.level import (
    WEIGHTS,
    Derivatives,
    Gradients,
    Level,
    Workspace,
    gradient_space,
    workspace,
)
from dnet.nets.kernels.matrix_product import matrix_product
from dnet.nets.kernels.pointwise import BLOCK, add_up, network_gradients, output_block
from dnet.nets.kernels.set_abstraction import look_up, prepare_cloud


@compiled(without_gil=True)
@no_type_check
def set_abstraction_gradients(
    level: Level,
    figures: Float32[np.ndarray, "b 2"],
    gradient: Float32[np.ndarray, "b s 16c"],
    summed: Float32[np.ndarray, "b s 16c"],
    derivatives: Derivatives,
    first: int,
    last: int,
) -> None:
    """Compute the derivatives of `set_abstraction` for clouds `first` to `last`.

    Args:
        level: As there.
        figures: From there.
        gradient: With respect to `summed`.
        summed: Receives once more what it did there.
        derivatives: Receives them.
        first: Cloud to begin with.
        last: Cloud to stop before.
    """
    work, gradients = workspace(level), gradient_space(level)
    parameters = level.parameters
    with_places = len(derivatives.points) > 0
    for cloud in range(first, last):
        look_up(work, level, cloud)
        prepare_cloud(work, level, cloud)
        work.figure[0], work.figure[1] = figures[cloud, 0], figures[cloud, 1]
        own = derivatives.parameters[cloud]
        own[: 2 * level.linear.shape[1]] = 0
        gradients.hidden[:] = 0
        for centroid in range(level.neighbours.shape[1]):
            gather_group(work, level, cloud, centroid)
            sum_group(work, summed, cloud, centroid)
            sum_group_gradients(work, gradients, gradient, cloud, centroid)
            scatter_group(work, gradients, own, centroid)
        through_norm(work, gradients, own, level, cloud)
        linear_gradients(work, gradients, derivatives, level, cloud)
        split_weights(work, gradients, parameters)
        spare = gradients.spare
        network_gradients(
            work.density_net, parameters, gradients.density_net, spare, own, with_places
        )
        offsets = network_gradients(
            work.weight_net, parameters, gradients.weight_net, spare, own, with_places
        )
        if len(derivatives.hidden):
            copy_hidden(gradients, derivatives, cloud)
        if with_places:
            scatter_offsets(gradients, derivatives, offsets, level, cloud)


@compiled_part
@no_type_check
def through_norm(
    work: Workspace, gradients: Gradients, own: Float32[np.ndarray, " _"], level: Level, cloud: int
) -> None:
    """Take sums of gradients through the first layer's norm.

    Each gathered value x gets weight * scale * g + tilt * (x - mean) + shift, where g is what
    the norm's output got. That is linear in g and x, so it is applied to their sums: over the
    places where a point was gathered, and over the members of a group.

    Args:
        work: Holds the cloud.
        gradients: As `scatter_group` leaves them; afterwards those of the first layer at each
            point and of each group's origin.
        own: As `scatter_group` leaves them; afterwards those of the norm's parameters.
        level: What went in.
        cloud: Which one it is.
    """
    neighbours = level.neighbours[cloud]
    groups, size = neighbours.shape
    points, channels = level.points.shape[1], work.hidden.shape[1]
    mean, scale = work.figure[0], work.figure[1]
    mean_part, slope_part = 0.0, 0.0
    for channel in range(channels):
        own[channel] *= scale
        weight = np.float64(level.parameters[channel])
        slope_part += weight * own[channel]
        mean_part += weight * own[channels + channel]
    count = groups * size * channels
    shift = np.float32(-mean_part / count * scale)
    tilt = np.float32(-slope_part / count * scale * scale)
    lanes_tilt, lanes_scale = spread(tilt), spread(scale)

    times = np.zeros(points, np.float32)
    places = np.zeros((points, 3), np.float32)
    for centroid in range(groups):
        for member in range(size):
            row = neighbours[centroid, member]
            times[row] += 1
            for axis in range(3):
                places[row, axis] += level.centroids[cloud, centroid, axis]
    for row in range(points):
        often = times[row]
        if often == 0:
            continue
        constant = spread(often * (shift - tilt * mean))
        slope = spread(often * tilt)
        x = spread(-tilt * places[row, 0])
        y = spread(-tilt * places[row, 1])
        z = spread(-tilt * places[row, 2])
        for channel in range(0, channels, LANES):
            place = row * channels + channel
            factor = multiply(load(level.parameters, channel), lanes_scale)
            value = multiply_add(load(work.hidden, place), slope, constant)
            value = multiply_add(load(level.linear, channel), x, value)
            value = multiply_add(load(level.linear, channels + channel), y, value)
            value = multiply_add(load(level.linear, 2 * channels + channel), z, value)
            value = multiply_add(load(gradients.hidden, place), factor, value)
            store(gradients.hidden, place, value)
    constant = spread(size * shift)
    minus = spread(np.float32(-1))
    for channel in range(0, channels, LANES):
        factor = multiply(load(level.parameters, channel), lanes_scale)
        for centroid in range(groups):
            place = centroid * channels + channel
            value = multiply_add(load(gradients.slopes, place), lanes_tilt, constant)
            value = multiply_add(load(gradients.sums, place), factor, value)
            store(gradients.sums, place, multiply(value, minus))


@compiled_part
@no_type_check
def linear_gradients(
    work: Workspace, gradients: Gradients, derivatives: Derivatives, level: Level, cloud: int
) -> None:
    """Write the derivatives of the first layer: through the points and through the centroids."""
    linear = derivatives.linear[cloud]
    count, channels = linear.shape
    out, inputs, hidden = at(linear, 0), at(work.inputs, 0), at(gradients.hidden, 0)
    shape = (count, len(gradients.hidden), channels)
    matrix_product(out, channels, inputs, 1, count, hidden, channels, shape)
    for channel in range(0, channels, LANES):
        for axis in range(3):
            place = axis * channels + channel
            total = load(linear, place)
            for centroid in range(len(gradients.sums)):
                factor = spread(level.centroids[cloud, centroid, axis])
                part = load(gradients.sums, centroid * channels + channel)
                total = multiply_add(factor, part, total)
            store(linear, place, total)


@compiled_part
@no_type_check
def copy_hidden(gradients: Gradients, derivatives: Derivatives, cloud: int) -> None:
    """Hand the gradient of the first layer's output out."""
    size = gradients.hidden.size
    for place in range(0, size, LANES):
        store(derivatives.hidden, cloud * size + place, load(gradients.hidden, place))


@compiled_part
@no_type_check
def split_weights(
    work: Workspace, gradients: Gradients, parameters: Float32[np.ndarray, " _"]
) -> None:
    """Turn the gradient of the weights into those of the two small networks' last norms."""
    weight_gradient, weight_sums = gradients.weight_net
    density_gradient, density_sums = gradients.density_net
    weight_sums[:] = 0
    density_sums[:] = 0
    members = len(gradients.weights)
    weight_values, density_values = work.weight_net.values, work.density_net.values
    weight_first = (len(weight_values) - WEIGHTS) * members
    density_first = (len(density_values) - 1) * members
    weight_mean = spread(work.weight_net.figures[-1, 0])
    density_mean = spread(work.density_net.figures[-1, 0])
    block = np.empty(WEIGHTS * BLOCK, np.float32)
    turned = np.empty(WEIGHTS * BLOCK, np.float32)
    densities = np.empty(BLOCK, np.float32)
    products = np.empty(BLOCK, np.float32)
    for row in range(0, members, BLOCK):
        output_block(block, work.weight_net, parameters, row)
        output_block(densities, work.density_net, parameters, row)
        for weight in range(0, WEIGHTS, LANES):
            for lane in range(0, BLOCK, LANES):
                source = at(gradients.weights, (row + lane) * WEIGHTS + weight)
                transpose(at(turned, weight * BLOCK + lane), BLOCK, source, WEIGHTS)
        products[:] = 0
        for weight in range(WEIGHTS):
            total, slope = spread(np.float32(0)), spread(np.float32(0))
            for lane in range(0, BLOCK, LANES):
                part = load(turned, weight * BLOCK + lane)
                value = load(block, weight * BLOCK + lane)
                store(products, lane, multiply_add(part, value, load(products, lane)))
                part = where_positive(value, multiply(part, load(densities, lane)))
                place = weight * members + row + lane
                store(weight_gradient, place, part)
                value = subtract(load(weight_values, weight_first + place), weight_mean)
                total, slope = add(total, part), multiply_add(part, value, slope)
            add_up(weight_sums, weight, total, slope)
        total, slope = spread(np.float32(0)), spread(np.float32(0))
        for lane in range(0, BLOCK, LANES):
            part = where_positive(load(densities, lane), load(products, lane))
            store(density_gradient, row + lane, part)
            value = subtract(load(density_values, density_first + row + lane), density_mean)
            total, slope = add(total, part), multiply_add(part, value, slope)
        add_up(density_sums, np.int64(0), total, slope)


@compiled_part
@no_type_check
def scatter_offsets(
    gradients: Gradients,
    derivatives: Derivatives,
    offsets: Float32[np.ndarray, "widest members"],
    level: Level,
    cloud: int,
) -> None:
    """Write the derivatives of points and centroids by way of the offsets, and of the origins."""
    groups, size = level.neighbours.shape[1:]
    points, centroids = derivatives.points[cloud], derivatives.centroids[cloud]
    points[:] = 0
    for centroid in range(groups):
        for axis in range(3):
            total = np.float32(0)
            for channel in range(gradients.sums.shape[1]):
                total += gradients.sums[centroid, channel] * level.linear[axis, channel]
            for member in range(size):
                row = level.neighbours[cloud, centroid, member]
                part = offsets[axis, centroid * size + member]
                points[row, axis] += part
                total -= part
            centroids[centroid, axis] = total
