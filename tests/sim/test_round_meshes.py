"""Round bodies are closed, symmetric, of the right size, and have no flat tetrahedra."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jaxtyping import Float64

from dnet.errors import TooFew
from dnet.sim.round_meshes import cylinder_mesh, hemi_ellipsoid_mesh
from dnet.sim.tetrahedra import TetrahedralMesh

Size = tuple[float, float, float]
Cells = tuple[int, int, int]
Mesher = Callable[[Size, Cells], TetrahedralMesh]

CYLINDER: tuple[Size, Cells] = ((0.12, 0.05, 0.05), (10, 6, 6))
HEMI_ELLIPSOID: tuple[Size, Cells] = ((0.13, 0.10, 0.04), (10, 8, 4))

meshers = st.sampled_from([cylinder_mesh, hemi_ellipsoid_mesh])
sizes = st.tuples(*[st.floats(0.03, 0.2)] * 3)
cells = st.tuples(st.integers(3, 7), st.integers(3, 7), st.integers(3, 5))


def analytic_volume(mesher: Mesher, size: Size) -> float:
    return float(np.prod(size)) * np.pi * (1 / 4 if mesher is cylinder_mesh else 1 / 6)


def dihedral_angles(mesh: TetrahedralMesh) -> Float64[np.ndarray, "_"]:
    """In degrees, six a tetrahedron."""
    # The gradient of a corner's weight points from the opposite face straight to the corner.
    gradients = np.linalg.inv(mesh.edges(mesh.nodes))
    gradients = np.concatenate([-gradients.sum(axis=1, keepdims=True), gradients], axis=1)
    gradients /= np.linalg.norm(gradients, axis=2, keepdims=True)
    one, other = np.triu_indices(4, 1)
    cosines = -np.einsum("tej,tej->te", gradients[:, one], gradients[:, other])
    return np.degrees(np.arccos(cosines)).ravel()


@settings(deadline=None, max_examples=40)
@given(mesher=meshers, size=sizes, cells=cells)
def test_tetrahedra_are_positive_and_within_the_round_body(
    mesher: Mesher, size: Size, cells: Cells
) -> None:
    mesh = mesher(size, cells)
    volumes = mesh.volumes(mesh.nodes)
    assert volumes.min() > 0
    assert volumes.sum() < analytic_volume(mesher, size)
    assert np.unique(mesh.tetrahedra).tolist() == list(range(len(mesh.nodes)))


@settings(deadline=None, max_examples=40)
@given(mesher=meshers, size=sizes, cells=cells)
def test_each_edge_of_the_surface_is_shared_by_two_triangles_that_agree_on_the_outside(
    mesher: Mesher, size: Size, cells: Cells
) -> None:
    mesh = mesher(size, cells)
    triangles = mesh.surface()
    edges = {
        (int(a), int(b)) for face in triangles for a, b in zip(face, np.roll(face, -1), strict=True)
    }
    assert len(edges) == 3 * len(triangles)
    assert edges == {(b, a) for a, b in edges}
    # Euler's formula: one body without holes.
    assert len(np.unique(triangles)) - len(edges) // 2 + len(triangles) == 2
    a, b, c = (mesh.nodes[triangles[:, k]] for k in range(3))
    flux = (a * np.cross(b, c)).sum() / 6
    assert flux == pytest.approx(mesh.volumes(mesh.nodes).sum())


@settings(deadline=None, max_examples=40)
@given(mesher=meshers, size=sizes, cells=cells)
def test_bodies_lie_on_the_table_and_mirror_themselves(
    mesher: Mesher, size: Size, cells: Cells
) -> None:
    nodes = mesher(size, cells).nodes
    assert nodes[:, 2].min() == 0
    assert np.all(np.ptp(nodes, axis=0) <= np.array(size) * (1 + 1e-12))
    places = {tuple(node) for node in (nodes + 0.0).tolist()}
    for mirror in ([-1, 1, 1], [1, -1, 1]):
        assert {tuple(node) for node in (nodes * mirror + 0.0).tolist()} == places


@pytest.mark.parametrize(
    ("mesher", "usual"), [(cylinder_mesh, CYLINDER), (hemi_ellipsoid_mesh, HEMI_ELLIPSOID)]
)
def test_usual_bodies_are_as_large_as_stated_and_near_their_true_volume(
    mesher: Mesher, usual: tuple[Size, Cells]
) -> None:
    size, cells = usual
    mesh = mesher(size, cells)
    assert 380 < len(mesh.nodes) < 460
    np.testing.assert_allclose(np.ptp(mesh.nodes, axis=0), size)
    volume = analytic_volume(mesher, size)
    assert 0.97 * volume < mesh.volumes(mesh.nodes).sum() < volume
    x, y, z = cells
    fine = mesher(size, (2 * x, 2 * y, 2 * z))
    lacking, fine_lacking = (1 - m.volumes(m.nodes).sum() / volume for m in (mesh, fine))
    assert fine_lacking < 0.3 * lacking, "second order: finer meshes approach the round body"


def test_the_surface_is_on_the_round_body() -> None:
    (length, width, height), cells = CYLINDER
    mesh = cylinder_mesh((length, width, height), cells)
    x, y, z = mesh.nodes[np.unique(mesh.surface())].T
    level = (2 * y / width) ** 2 + (2 * z / height - 1) ** 2
    on_an_end = np.isclose(np.abs(x), length / 2)
    np.testing.assert_allclose(level[~on_an_end], 1)
    assert level.max() <= 1 + 1e-12

    (length, width, height), cells = HEMI_ELLIPSOID
    mesh = hemi_ellipsoid_mesh((length, width, height), cells)
    x, y, z = mesh.nodes[np.unique(mesh.surface())].T
    level = (2 * x / length) ** 2 + (2 * y / width) ** 2 + (z / height) ** 2
    np.testing.assert_allclose(level[z > 0], 1)
    assert level.max() <= 1 + 1e-12


@pytest.mark.parametrize(
    ("mesher", "usual"), [(cylinder_mesh, CYLINDER), (hemi_ellipsoid_mesh, HEMI_ELLIPSOID)]
)
def test_no_tetrahedron_is_flat(mesher: Mesher, usual: tuple[Size, Cells]) -> None:
    """The least altitude is what the time step of a simulation goes by."""
    mesh = mesher(*usual)
    angles = dihedral_angles(mesh)
    assert angles.min() > 25
    assert angles.max() < 142
    assert mesh.least_altitude() > 0.0025


def test_too_few_cells_are_refused() -> None:
    with pytest.raises(TooFew, match="cells along y is 2, must be at least 3"):
        cylinder_mesh((0.1, 0.05, 0.05), (4, 2, 6))
    with pytest.raises(TooFew, match="cells along z is 1, must be at least 2"):
        hemi_ellipsoid_mesh((0.1, 0.1, 0.05), (4, 4, 1))
