"""Meshes fill their box, face outwards, and survive the trip through VTK."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnet.sim.tetrahedra import box_mesh, to_vtk

cells = st.tuples(st.integers(1, 4), st.integers(1, 4), st.integers(1, 4))
size = st.tuples(*[st.floats(0.01, 0.2)] * 3)


@settings(deadline=None)
@given(size=size, cells=cells)
def test_tetrahedra_fill_the_box(
    size: tuple[float, float, float], cells: tuple[int, int, int]
) -> None:
    mesh = box_mesh(size, cells)
    volumes = mesh.volumes(mesh.nodes)
    assert volumes.min() > 0
    assert volumes.sum() == pytest.approx(np.prod(size))
    assert len(mesh.tetrahedra) == 5 * np.prod(cells)
    np.testing.assert_allclose(np.ptp(mesh.nodes, axis=0), size)


@settings(deadline=None)
@given(size=size, cells=cells)
def test_the_surface_is_closed_and_faces_outwards(
    size: tuple[float, float, float], cells: tuple[int, int, int]
) -> None:
    mesh = box_mesh(size, cells)
    a, b, c = (mesh.nodes[mesh.surface()[:, k]] for k in range(3))
    areas = np.cross(b - a, c - a) / 2
    np.testing.assert_allclose(areas.sum(axis=0), 0, atol=1e-12)
    # The divergence theorem: the flux of x through a closed outward surface is its volume.
    flux = ((a + b + c) / 3 * areas).sum() / 3
    assert flux == pytest.approx(np.prod(size))
    # Neighbouring cells agree on the diagonal of their common face, so none is left inside.
    x, y, z = size
    assert np.linalg.norm(areas, axis=1).sum() == pytest.approx(2 * (x * y + y * z + z * x))


def test_volume_ratios_see_stretch_and_inversion() -> None:
    mesh = box_mesh((0.1, 0.1, 0.1), (2, 2, 2))
    np.testing.assert_allclose(mesh.volume_ratios(mesh.nodes * [2, 1, 1]), 2)
    np.testing.assert_allclose(mesh.volume_ratios(mesh.nodes * [-1, 1, 1]), -1)


def test_vtk_lists_every_node_and_tetrahedron() -> None:
    mesh = box_mesh((0.1, 0.2, 0.3), (2, 1, 1))
    lines = to_vtk(mesh).splitlines()
    start = lines.index(f"POINTS {len(mesh.nodes)} double") + 1
    nodes = np.array([line.split() for line in lines[start : start + len(mesh.nodes)]], float)
    np.testing.assert_allclose(nodes, mesh.nodes)
    start = lines.index(f"CELLS {len(mesh.tetrahedra)} {5 * len(mesh.tetrahedra)}") + 1
    rows = np.array([line.split() for line in lines[start : start + len(mesh.tetrahedra)]], int)
    np.testing.assert_array_equal(rows[:, 1:], mesh.tetrahedra)
