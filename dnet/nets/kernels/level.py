"""What goes into a level of PointConv, what its derivatives are, and room for one cloud of it."""

from typing import NamedTuple, no_type_check

import numpy as np
from jaxtyping import Float32, Int64, Integer

from dnet.compiled import compiled_part
from dnet.nets.kernels.matrix_product import ROWS
from dnet.nets.kernels.pointwise import Network, Side, parameter_count

WEIGHTS = 16
"""Outputs of WeightNet."""


class Level(NamedTuple):
    """What goes into one level, for a few clouds."""

    points: Float32[np.ndarray, "b n 3"]
    features: Float32[np.ndarray, "b n d"]
    centroids: Float32[np.ndarray, "b s 3"]
    neighbours: Integer[np.ndarray, "b s k"]
    """Rows of the points that each centroid gathers."""
    inverse_density: Float32[np.ndarray, "b n"]
    linear: Float32[np.ndarray, "inputs c"]
    """The first layer: the weights of each input in a row, then the biases, then rows of zeros."""
    parameters: Float32[np.ndarray, " _"]
    """Of the first layer's norm, of WeightNet and of DensityNet, in that order, and more."""
    weight_widths: tuple[int, ...]
    """Channels of WeightNet's input and layers."""
    density_widths: tuple[int, ...]
    """Channels of DensityNet's input and layers."""


class Derivatives(NamedTuple):
    """Those of a level's sums for a few clouds; the last three are empty where not wanted."""

    linear: Float32[np.ndarray, "b inputs c"]
    """Of the first layer, laid out like its weights."""
    parameters: Float32[np.ndarray, "b _"]
    hidden: Float32[np.ndarray, "_ n c"]
    """Of the first layer's output at the points."""
    points: Float32[np.ndarray, "_ n 3"]
    """Of the points, by way of the offsets from the centroids alone."""
    centroids: Float32[np.ndarray, "_ s 3"]


class Workspace(NamedTuple):
    """What is known of the cloud at hand and of one of its groups."""

    weight_net: Network
    density_net: Network
    inputs: Float32[np.ndarray, "rows inputs"]
    """Of the first layer at each point; rows of zeros fill up."""
    hidden: Float32[np.ndarray, "rows c"]
    """The first layer at each point."""
    weights: Float32[np.ndarray, "members 16"]
    """WeightNet times DensityNet at each member of each group."""
    group: Float32[np.ndarray, "k c"]
    """What goes into the sum from each member of a group."""
    places: Int64[np.ndarray, " k"]
    """Where in `hidden` each member of a group is."""
    origin: Float32[np.ndarray, " c"]
    """What comes off each member of a group: the centroid's part and the mean."""
    figure: Float32[np.ndarray, "2"]
    """Mean and one over the standard deviation of all members of all groups."""


class Gradients(NamedTuple):
    """Room for gradients of the cloud at hand and of one of its groups."""

    hidden: Float32[np.ndarray, "rows c"]
    """Of the first layer's norm, then of the first layer, summed for each point."""
    sums: Float32[np.ndarray, "s c"]
    """The same summed over each group, then that of the group's origin."""
    slopes: Float32[np.ndarray, "s c"]
    """Sum over each group of what the norm takes, less the mean."""
    group: Float32[np.ndarray, "k c"]
    """Of what goes into the sum from each member of a group."""
    turned: Float32[np.ndarray, "16 c"]
    """Of the sums of a group, weights first."""
    weights: Float32[np.ndarray, "members 16"]
    """Of the weights of each member of each group."""
    weight_net: Side
    density_net: Side
    spare: Float32[np.ndarray, "widest members"]
    """For the small networks."""


@compiled_part
@no_type_check
def workspace(level: Level) -> Workspace:
    """Return room for one cloud of a level."""
    inputs, channels = level.linear.shape
    groups, size = level.neighbours.shape[1:]
    members = groups * size
    rows = (level.points.shape[1] + ROWS - 1) // ROWS * ROWS
    begin = 2 * channels
    weight_net = network(level.weight_widths, begin, members)
    begin += parameter_count(level.weight_widths)
    density_net = network(level.density_widths, begin, members)
    return Workspace(
        weight_net,
        density_net,
        np.zeros((rows, inputs), np.float32),
        np.empty((rows, channels), np.float32),
        np.empty((members, WEIGHTS), np.float32),
        np.empty((size, channels), np.float32),
        np.empty(size, np.int64),
        np.empty(channels, np.float32),
        np.empty(2, np.float32),
    )


@compiled_part
@no_type_check
def gradient_space(level: Level) -> Gradients:
    """Return room for the gradients of one cloud of a level."""
    channels = level.linear.shape[1]
    groups, size = level.neighbours.shape[1:]
    members = groups * size
    weight_net = side(max(level.weight_widths), members)
    density_net = side(max(level.density_widths), members)
    widest = max(len(weight_net.gradient), len(density_net.gradient))
    return Gradients(
        np.empty((level.points.shape[1], channels), np.float32),
        np.empty((groups, channels), np.float32),
        np.empty((groups, channels), np.float32),
        np.empty((size, channels), np.float32),
        np.empty((WEIGHTS, channels), np.float32),
        np.empty((members, WEIGHTS), np.float32),
        weight_net,
        density_net,
        np.empty((widest, members), np.float32),
    )


@compiled_part
@no_type_check
def network(widths: tuple[int, ...], begin: int, members: int) -> Network:
    """Return room for a small network whose parameters begin there."""
    values = np.empty((sum(widths), members), np.float32)
    return Network(widths, begin, values, np.empty((len(widths) - 1, 3), np.float32))


@compiled_part
@no_type_check
def side(widest: int, members: int) -> Side:
    """Return room for the gradients of a small network with layers of so many channels."""
    gradient = np.empty((widest, members), np.float32)
    return Side(gradient, np.empty((widest, 2), np.float64))
