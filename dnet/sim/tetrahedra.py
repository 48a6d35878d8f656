"""Tetrahedral meshes of boxes, and the measures of any tetrahedral mesh."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

Vertices = Float64[np.ndarray, "_ 3"]

# The eight corners of a cell are numbered 4 dx + 2 dy + dz. Five tetrahedra fill it; neighbouring
# cells take mirrored splits, so that the diagonals of their common face agree.
EVEN_SPLIT = ((0, 4, 2, 1), (6, 2, 4, 7), (5, 1, 7, 4), (3, 7, 1, 2), (1, 2, 4, 7))
ODD_SPLIT = ((4, 0, 5, 6), (2, 6, 3, 0), (1, 0, 3, 5), (7, 6, 5, 3), (0, 3, 5, 6))


@dataclass(frozen=True, eq=False)
class TetrahedralMesh:
    """Nodes and positively oriented tetrahedra."""

    nodes: Vertices
    tetrahedra: Int64[np.ndarray, "_ 4"]

    def edges(self, nodes: Vertices) -> Float64[np.ndarray, "_ 3 3"]:
        """Return each tetrahedron's edges from its first node, as columns."""
        first = nodes[self.tetrahedra[:, 0]]
        return np.stack([nodes[self.tetrahedra[:, k]] - first for k in (1, 2, 3)], axis=-1)

    def volumes(self, nodes: Vertices) -> Float64[np.ndarray, "_"]:
        """Return each tetrahedron's signed volume in cubic metres."""
        return np.asarray(np.linalg.det(self.edges(nodes)) / 6)

    def volume_ratios(self, nodes: Vertices) -> Float64[np.ndarray, "_"]:
        """Return each tetrahedron's volume over its rest volume: J, negative where inverted."""
        return self.volumes(nodes) / self.volumes(self.nodes)

    def least_altitude(self) -> float:
        """Return the least distance of a node from the opposite face of its tetrahedron."""
        # The rows of the inverse edge matrix are the gradients of the corners' weights: each is
        # as long as the altitude of its corner is short.
        gradients = np.linalg.inv(self.edges(self.nodes))
        first = -gradients.sum(axis=1, keepdims=True)
        lengths = np.linalg.norm(np.concatenate([first, gradients], axis=1), axis=2)
        return float(1 / lengths.max())

    def surface(self) -> Int64[np.ndarray, "_ 3"]:
        """Return the triangles that bound the mesh, outward by the right-hand rule."""
        corners = self.tetrahedra
        faces = np.concatenate(
            [corners[:, order] for order in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))]
        )
        _, where, count = np.unique(
            np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True
        )
        return faces[count[where.ravel()] == 1]


def box_mesh(size: tuple[float, float, float], cells: tuple[int, int, int]) -> TetrahedralMesh:
    """Return a box about the origin, `cells` cells along each axis, five tetrahedra a cell.

    Args:
        size: Length along x, y and z in metres.
        cells: Number of cells along x, y and z, at least 1 each.
    """
    axes = [np.linspace(-s / 2, s / 2, n + 1) for s, n in zip(size, cells, strict=True)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    return split_cells(nodes, *grid_cells(cells))


def grid_cells(
    cells: tuple[int, int, int],
) -> tuple[Int64[np.ndarray, "n 8"], Bool[np.ndarray, "n"]]:
    """Return the eight corners of each cell of a grid, and which split each takes.

    The grid has one node more than cells along each axis; nodes and cells count along z first.
    """
    index = np.arange(np.prod([n + 1 for n in cells])).reshape([n + 1 for n in cells])
    i, j, k = np.meshgrid(*(np.arange(n) for n in cells), indexing="ij")
    corners = np.stack(
        [index[i + a, j + b, k + c] for a in (0, 1) for b in (0, 1) for c in (0, 1)], axis=-1
    ).reshape(-1, 8)
    return corners, ((i + j + k) % 2 == 0).ravel()


def split_cells(
    nodes: Vertices, corners: Int64[np.ndarray, "n 8"], even: Bool[np.ndarray, "n"]
) -> TetrahedralMesh:
    """Return a mesh of hexahedral cells, each split into five positively oriented tetrahedra.

    Args:
        nodes: In metres.
        corners: The eight nodes of each cell.
        even: Whether a cell takes the even split; cells that share a face must differ.
    """
    split = np.where(even[:, None, None], np.array(EVEN_SPLIT), np.array(ODD_SPLIT))
    tetrahedra = np.take_along_axis(corners[:, None, :], split, axis=2).reshape(-1, 4)
    inverted = TetrahedralMesh(nodes, tetrahedra).volumes(nodes) < 0
    tetrahedra[inverted] = tetrahedra[inverted][:, [0, 1, 3, 2]]
    return TetrahedralMesh(nodes, tetrahedra.astype(np.int64))


def to_vtk(mesh: TetrahedralMesh) -> str:
    """Return the mesh as a legacy VTK file, the form that Bullet loads."""
    points = "\n".join(f"{x:.9g} {y:.9g} {z:.9g}" for x, y, z in mesh.nodes)
    cells = "\n".join(f"4 {a} {b} {c} {d}" for a, b, c, d in mesh.tetrahedra)
    count = len(mesh.tetrahedra)
    return (
        "# vtk DataFile Version 2.0\nsoft body\nASCII\nDATASET UNSTRUCTURED_GRID\n"
        f"POINTS {len(mesh.nodes)} double\n{points}\n"
        f"\nCELLS {count} {5 * count}\n{cells}\n"
        f"\nCELL_TYPES {count}\n" + "10\n" * count
    )
