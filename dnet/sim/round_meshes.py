"""Tetrahedral meshes of round bodies: a core of cells, wrapped in one layer of cells more.

A grid of cells that is bent as a whole into a round shape has cells at its edges whose two outer
faces lie in one plane, and in them tetrahedra as flat. So these cells are left out, and the gaps
that they leave are closed. Every cell is then close to a cube, which keeps the time step long,
and the mesh is symmetric and the same on every machine.

Free meshers do not serve here: Delaunay meshes of points in such a body have slivers, and fTetWild
(Hu et al. 2020) makes another mesh on every run (its issue 72).
"""

import numpy as np
from jaxtyping import Bool

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
    """Return a body that is round on some sides, each covered by a layer of cells.

    Args:
        size: Along x, y and z, in metres.
        cells: Number of cells along x, y and z, with the layers.
        low: Number of layers, 0 or 1, on the sides of least x, y and z.
        high: The same for the other sides. An axis with a layer on this side only has the
            middle of the body on the other.
    """
    for axis, count, least in zip("xyz", cells, np.add(low, high) + 1, strict=True):
        if count < least:
            raise TooFew(f"the number of mesh cells along {axis}", count, int(least))
    shape = [count + 1 for count in cells]
    first, last = np.array(low), np.array(cells) - high
    grid = np.indices(shape).reshape(3, -1).T
    # A node of a layer stands on one of the core: where two layers meet, on the same one.
    foot = np.clip(grid, first, last)
    outside = foot != grid
    name = 2 * np.ravel_multi_index(tuple(foot.T), shape) + outside.any(axis=1)
    corners, even = grid_cells(cells)
    kept = outside[corners].any(axis=1).sum(axis=1) < 2
    used, corners = np.unique(name[corners[kept]], return_inverse=True)
    foot = np.stack(np.unravel_index(used // 2, shape), axis=-1)
    centred = np.equal(low, high)
    middle = np.where(centred, (first + last) / 2, first)
    places = (foot - middle) / (last - middle)
    nodes = _shaped(places, used % 2 == 1, round_axes=np.array(high) == 1)
    nodes = nodes * size * np.where(centred, 0.5, 1.0)
    nodes[:, 2] -= nodes[:, 2].min()
    return split_cells(nodes, corners.reshape(-1, 8), even[kept])


def _shaped(
    foot: Vertices, outside: Bool[np.ndarray, "_"], *, round_axes: Bool[np.ndarray, "3"]
) -> Vertices:
    """Return where nodes are in a body of radius 1.

    Args:
        foot: Where a node is in the core, or the node that it stands on, from -1 to 1.
        outside: Whether it stands on the core: it is on the surface then.
        round_axes: The axes along which the body is round.
    """
    flat = np.where(round_axes, foot, 0.0)
    reach = np.abs(flat).max(axis=1, keepdims=True)
    # Close to tan(pi / 4 x), which divides the surface by equal angles, but without a function
    # whose last digit differs from one processor to another.
    angular = flat * (np.pi / 4 + (1 - np.pi / 4) * flat**2)
    length = np.sqrt((angular**2).sum(axis=1, keepdims=True))
    surface = angular / np.where(length > 0, length, 1.0)
    core = CORE * ((1 - ROUNDNESS * reach) * angular + ROUNDNESS * reach**2 * surface)
    return np.where(round_axes, np.where(outside[:, None], surface, core), foot)
