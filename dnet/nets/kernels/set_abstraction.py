"""Set abstraction of a few clouds, compiled: no gathered group is stored.

One cloud is done after the other, so that what belongs to it stays in the cache. Each group of
neighbours is gathered, normalised and summed where it is needed.
"""

from typing import no_type_check

import numpy as np
from jaxtyping import Float32

from dnet.compiled import compiled, compiled_part
from dnet.nets.kernels.group import find_moments, gather_group, sum_group
from dnet.nets.kernels.lanes import LANES, at, load, multiply, store, transpose
from dnet.nets.kernels.level import WEIGHTS, Level, Workspace, workspace
from dnet.nets.kernels.matrix_product import matrix_product
from dnet.nets.kernels.pointwise import BLOCK, output_block, run_network


@compiled(without_gil=True)
@no_type_check
def set_abstraction(
    level: Level,
    summed: Float32[np.ndarray, "b s 16c"],
    figures: Float32[np.ndarray, "b 2"],
    first: int,
    last: int,
) -> bool:
    """Gather, normalise, weigh and sum the groups of clouds `first` to `last`.

    Args:
        level: What goes in.
        summed: Receives what goes into the last layer.
        figures: Receives mean and one over the standard deviation of the first layer's norm.
        first: Cloud to begin with.
        last: Cloud to stop before.

    Returns:
        Whether all neighbours are rows of the cloud.
    """
    work = workspace(level)
    for cloud in range(first, last):
        if not look_up(work, level, cloud):
            return False
        prepare_cloud(work, level, cloud)
        find_moments(work, level, cloud)
        figures[cloud, 0], figures[cloud, 1] = work.figure[0], work.figure[1]
        for centroid in range(level.neighbours.shape[1]):
            gather_group(work, level, cloud, centroid)
            sum_group(work, summed, cloud, centroid)
    return True


@compiled_part
@no_type_check
def look_up(work: Workspace, level: Level, cloud: int) -> bool:
    """Write the inputs of WeightNet and DensityNet, and return whether all rows exist."""
    points, centroids = level.points[cloud], level.centroids[cloud]
    neighbours, inverse_density = level.neighbours[cloud], level.inverse_density[cloud]
    offsets, scale = work.weight_net.values, work.density_net.values
    groups, size = neighbours.shape
    for centroid in range(groups):
        begin = centroid * size
        largest = np.float32(-np.inf)
        for member in range(size):
            row = neighbours[centroid, member]
            if row < 0 or row >= len(points):
                return False
            for axis in range(3):
                offsets[axis, begin + member] = points[row, axis] - centroids[centroid, axis]
            scale[0, begin + member] = inverse_density[row]
            largest = max(largest, inverse_density[row])
        for place in range(begin, begin + size):
            scale[0, place] /= largest
    return True


@compiled_part
@no_type_check
def prepare_cloud(work: Workspace, level: Level, cloud: int) -> None:
    """Apply the first layer to every point, and the small networks to every member."""
    points, features = level.points[cloud], level.features[cloud]
    count, channels = level.linear.shape
    known = features.shape[1]
    for row in range(len(points)):
        for axis in range(3):
            work.inputs[row, axis] = points[row, axis]
        for feature in range(known):
            work.inputs[row, 3 + feature] = features[row, feature]
        work.inputs[row, 3 + known] = 1
    hidden, inputs, linear = at(work.hidden, 0), at(work.inputs, 0), at(level.linear, 0)
    shape = (len(work.hidden), count, channels)
    matrix_product(hidden, channels, inputs, count, 1, linear, channels, shape)
    run_network(work.weight_net, level.parameters)
    run_network(work.density_net, level.parameters)
    block = np.empty(WEIGHTS * BLOCK, np.float32)
    densities = np.empty(BLOCK, np.float32)
    for row in range(0, len(work.weights), BLOCK):
        output_block(block, work.weight_net, level.parameters, row)
        output_block(densities, work.density_net, level.parameters, row)
        for weight in range(WEIGHTS):
            for lane in range(0, BLOCK, LANES):
                place = weight * BLOCK + lane
                store(block, place, multiply(load(block, place), load(densities, lane)))
        for lane in range(0, BLOCK, LANES):
            for weight in range(0, WEIGHTS, LANES):
                target = at(work.weights, (row + lane) * WEIGHTS + weight)
                transpose(target, WEIGHTS, at(block, weight * BLOCK + lane), BLOCK)
    block[0] = densities[0] = 0  # They must outlive the pointers.
