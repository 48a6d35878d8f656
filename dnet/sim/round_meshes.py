"""Tetrahedral meshes of round bodies: a core of cells, wrapped in one layer of cells more.

A grid of cells that is bent as a whole into a round shape has cells at its edges whose two outer
faces lie in one plane, and in them tetrahedra as flat. So these cells are left out, and the gaps
that they leave are closed. Every cell is then close to a cube, which keeps the time step long,
and the mesh is symmetric and the same on every machine. Delaunay meshes of such bodies have
slivers; TetWild (Hu et al. 2020) has none, but makes another mesh on every run.
"""

import numpy as np
from jaxtyping import Bool, Float64, Int64

from dnet.errors import TooFew
from dnet.sim.tetrahedra import TetrahedralMesh, Vertices, grid_cells, split_cells

Sides = tuple[int, int, int]

CORE = 0.65
"""Distance of the core's faces from the middle, over that of the surface. This and the next are
near the best for the least altitude of a tetrahedron, whatever the number of cells."""
ROUNDNESS = 0.6
"""How round the core is on its outside: 0 for a square, 1 for a circle."""


def cylinder_mesh(size: tuple[float, float, float], cells: tuple[int, int, int]) -> TetrahedralMesh:
    """Return a lying cylinder, its axis along x and above the origin, its lowest nodes on z = 0.

    Args:
        size: Length along x, and diameters of the elliptic section along y and z, in metres.
        cells: Number of cells along x, and across the section along y and z.

    Raises:
        TooFew: If there is less than 1 cell along x, or there are less than 3 across.
    """
    return _wrapped(size, cells, low=(0, 1, 1), high=(0, 1, 1))


def hemi_ellipsoid_mesh(
    size: tuple[float, float, float], cells: tuple[int, int, int]
) -> TetrahedralMesh:
    """Return the upper half of an ellipsoid, its base about the origin and on z = 0.

    Args:
        size: Diameters of the base along x and y, and the height, in metres.
        cells: Number of cells across the base along x and y, and along the height.

    Raises:
        TooFew: If there are less than 3 cells across, or less than 2 along the height.
    """
    return _wrapped(size, cells, low=(1, 1, 0), high=(1, 1, 1))


def _wrapped(
    size: tuple[float, float, float], cells: tuple[int, int, int], *, low: Sides, high: Sides
) -> TetrahedralMesh:
    """Return a round body, from a grid whose outermost layers are 1 at the sides that are round.

    Args:
        size: In metres.
        cells: Number of cells along each axis.
        low: Which sides of least x, y and z are round: 1 or 0.
        high: Which sides of greatest x, y and z are round. An axis that is round on this side
            only has its middle on the other.
    """
    for axis, count, least in zip("xyz", cells, np.add(low, high) + 1, strict=True):
        if count < least:
            raise TooFew(f"the number of mesh cells along {axis}", count, int(least))
    shape = [count + 1 for count in cells]
    first, last = np.array(low), np.array(cells) - high
    grid = np.stack(np.indices(shape), axis=-1).reshape(-1, 3)
    # A node of the layer stands on one of the core: where two sides meet, on the same one.
    foot = np.clip(grid, first, last)
    name = 2 * np.ravel_multi_index(tuple(foot.T), shape) + (foot != grid).any(axis=1)
    corners, even = grid_cells(cells)
    sides = (foot != grid)[corners].any(axis=1).sum(axis=1)
    used, numbers = np.unique(name[corners[sides < 2]], return_inverse=True)
    foot = np.stack(np.unravel_index(used // 2, shape), axis=-1)
    middle = np.where(np.equal(low, high), (first + last) / 2, first)
    nodes = np.array(size) * _shaped(
        (foot - middle) / (last - middle),
        used % 2 == 1,
        round_axes=np.array(high, dtype=bool),
    )
    nodes = nodes * np.where(np.equal(low, high), 0.5, 1.0)
    nodes[:, 2] -= nodes[:, 2].min()
    return split_cells(nodes, numbers.reshape(-1, 8), even[sides < 2])


def _shaped(
    foot: Vertices, outside: Bool[np.ndarray, "_"], *, round_axes: Bool[np.ndarray, "3"]
) -> Vertices:
    """Return where nodes are in a body of radius 1.

    Args:
        foot: Each node's place in the core, or that of the node it stands on, from -1 to 1.
        outside: Whether it stands on the core, and so belongs to the surface.
        round_axes: The axes about which the body is round.
    """
    flat = np.where(round_axes, foot, 0.0)
    reach = np.abs(flat).max(axis=1, keepdims=True)
    # Close to tan(pi / 4 x), which parts the surface into equal angles, but without a function
    # whose last digit differs between processors.
    angular = flat * (np.pi / 4 + (1 - np.pi / 4) * flat**2)
    length = np.sqrt((angular**2).sum(axis=1, keepdims=True))
    surface = angular / np.where(length > 0, length, 1.0)
    core = CORE * ((1 - ROUNDNESS * reach) * angular + ROUNDNESS * reach**2 * surface)
    return np.where(round_axes, np.where(outside[:, None], surface, core), foot)
