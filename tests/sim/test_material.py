"""The material is the one that was asked for."""

from contextlib import closing

import numpy as np
import pytest

from dnet.sim.arms import Placement
from dnet.sim.bullet_world import BulletWorld
from dnet.sim.material import lame, stable_neo_hookean
from dnet.sim.tetrahedra import box_mesh
from dnet.sim.tissue import tissue_mesh
from dnet.types import Scene
from tests.sim.oracle import Oracle

SCENE = Scene((0.0, 0.0), 0.0, (-0.045, 0.0, 0.04), (0.04, 0.01, 0.04))
DISPLACEMENTS = [(0.04, 0.0, 0.02), (0.01, 0.04, 0.03), (-0.015, -0.02, 0.01)]


def test_the_oracle_has_the_gradient_of_its_energy() -> None:
    mesh = box_mesh((0.1, 0.06, 0.04), (3, 2, 2))
    oracle = Oracle(mesh, mu=500.0, lam=900.0)
    random = np.random.default_rng(0)
    nodes = mesh.nodes + random.normal(scale=2e-3, size=mesh.nodes.shape)
    direction = random.normal(size=nodes.shape)
    step = 1e-6
    ahead, _ = oracle.energy_and_gradient(nodes + step * direction)
    behind, _ = oracle.energy_and_gradient(nodes - step * direction)
    _, gradient = oracle.energy_and_gradient(nodes)
    assert (ahead - behind) / (2 * step) == pytest.approx(float((gradient * direction).sum()))


def test_the_rest_shape_has_no_forces() -> None:
    mesh = box_mesh((0.1, 0.1, 0.04), (8, 8, 4))
    mu, lam = stable_neo_hookean(1000.0, 0.3)
    _, gradient = Oracle(mesh, mu=mu, lam=lam).energy_and_gradient(mesh.nodes)
    assert np.abs(gradient).max() < 1e-12


@pytest.mark.parametrize(("young", "poisson"), [(1000.0, 0.3), (5000.0, 0.4), (300.0, 0.1)])
def test_small_strains_feel_young_and_poisson(young: float, poisson: float) -> None:
    """The energy's second derivative at rest is the linear material's."""
    mesh = box_mesh((0.1, 0.1, 0.1), (1, 1, 1))
    oracle = Oracle(
        mesh, mu=stable_neo_hookean(young, poisson).mu, lam=stable_neo_hookean(young, poisson).lam
    )
    mu, lam = lame(young, poisson)
    strain = 1e-4
    stretch = np.diag([strain, -0.3 * strain, 0.2 * strain])
    energy, _ = oracle.energy_and_gradient(mesh.nodes @ (np.eye(3) + stretch))
    rest, _ = oracle.energy_and_gradient(mesh.nodes)
    linear = mu * (stretch**2).sum() + lam / 2 * np.trace(stretch) ** 2
    assert (energy - rest) / 1e-3 == pytest.approx(linear, rel=2e-3)


@pytest.mark.parametrize("displacement", DISPLACEMENTS)
def test_settled_shapes_agree_with_an_independent_solver(
    displacement: tuple[float, float, float],
) -> None:
    """Half a millimetre in the mean over all nodes, for motions of up to five centimetres."""
    with closing(BulletWorld()) as world:
        world.reset(SCENE)
        rest = world.nodes().astype(np.float64)
        before = Placement().joints_at(1, world.tip)
        after = Placement().joints_at(1, world.tip + displacement, near=before)
        world.follow(np.array([before, after]), np.array([0.0, 0.5]))
        assert world.settle().settled
        settled = world.nodes().astype(np.float64)
        mesh = tissue_mesh(SCENE.tissue)
        moved = np.linalg.norm(rest - np.array(SCENE.manipulation_point), axis=1)
        gripped = np.flatnonzero(moved < world.settings.jaw_radius)
        held = np.flatnonzero(mesh.nodes[:, 0] == mesh.nodes[:, 0].min())
        mu, lam = stable_neo_hookean(SCENE.tissue.young, SCENE.tissue.poisson)

    pinned = np.concatenate([held, gripped])
    targets = np.concatenate([rest[held], rest[gripped] + np.array(displacement)])
    expected = Oracle(mesh, mu=mu, lam=lam).settle(rest, pinned, targets)
    error = np.linalg.norm(settled - expected, axis=1)
    print(f"{displacement}: mean {error.mean() * 1e3:.3f} mm, worst {error.max() * 1e3:.3f} mm")
    assert error.mean() < 0.5e-3
    assert np.linalg.norm(settled - rest, axis=1).max() > 0.02
