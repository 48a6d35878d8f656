import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from dnet.evaluation.material_points import MaterialPoints
from dnet.sim.tissue import tissue_mesh
from dnet.types import Cloud, Tissue

MESH = tissue_mesh(Tissue())
NODES, SURFACE = MESH.nodes.astype(np.float32), MESH.surface()


def on_surface(seed: int, count: int = 50) -> Cloud:
    rng = np.random.default_rng(seed)
    corners = MESH.nodes[SURFACE[rng.integers(len(SURFACE), size=count)]]
    return np.einsum("nc,ncx->nx", rng.dirichlet((1, 1, 1), count), corners).astype(np.float32)


@given(seed=st.integers(0, 99))
@settings(max_examples=10, deadline=None)
def test_points_of_the_surface_are_where_they_are(seed: int) -> None:
    points = on_surface(seed)
    np.testing.assert_allclose(
        MaterialPoints.of(points, NODES, SURFACE).at(NODES), points, atol=1e-7
    )


@given(seed=st.integers(0, 99))
@settings(max_examples=10, deadline=None)
def test_points_follow_an_affine_map_of_the_nodes(seed: int) -> None:
    points = on_surface(seed)
    rng = np.random.default_rng(seed)
    map_, shift = rng.normal(size=(3, 3)), rng.normal(size=3)
    moved = (NODES @ map_ + shift).astype(np.float32)
    found = MaterialPoints.of(points, NODES, SURFACE).at(moved)
    np.testing.assert_allclose(found, points @ map_ + shift, atol=2e-6)


def test_a_point_off_the_surface_falls_on_the_nearest() -> None:
    points = np.array([[0.0, 0.0, 0.07], [0.06, 0.0, 0.02], [0.06, 0.06, 0.06]], np.float32)
    found = MaterialPoints.of(points, NODES, SURFACE).at(NODES)
    np.testing.assert_allclose(
        found, [[0, 0, 0.04], [0.05, 0, 0.02], [0.05, 0.05, 0.04]], atol=1e-7
    )
