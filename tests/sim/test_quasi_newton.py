"""A minimisation says truly how it ended."""

import numpy as np
from scipy.sparse import csr_array

from dnet.sim.elastic_energy import elements, energy_and_gradient
from dnet.sim.envelope import factorised
from dnet.sim.material import Lame
from dnet.sim.quasi_newton import (
    MEMORY,
    Descent,
    Limits,
    empty_memory,
    minimise,
    remember,
)
from dnet.sim.tetrahedra import box_mesh

MESH = box_mesh((0.04, 0.02, 0.02), (4, 2, 2))
BODY = elements(MESH, Lame(mu=500.0, lam=900.0))
FREE = len(MESH.nodes) - 9
"""The last nodes are those of an end face: pinned."""
IDENTITY = factorised(csr_array(30.0 * np.eye(FREE)))
"""A poor guess of the Hessian, in N/m: what is learned on the way must make up for it."""


def shaken(scale: float = 2e-3) -> np.ndarray:
    points = np.ascontiguousarray(MESH.nodes.T)
    points[:, :FREE] += np.random.default_rng(0).normal(scale=scale, size=(3, FREE))
    return points


def descend(points: np.ndarray, *, patience: int) -> Descent:
    limits = Limits(1e-7, patience)
    return Descent(*minimise(points, BODY, IDENTITY, empty_memory(FREE), limits))


def test_a_shaken_body_finds_back_to_rest() -> None:
    points = shaken()
    found = descend(points, patience=500)
    assert found.converged
    assert found.residual < 1e-7
    np.testing.assert_allclose(points.T, MESH.nodes, atol=1e-5)


def test_a_crumpled_body_comes_to_rest_as_well() -> None:
    """Where the energy is not convex, and half of the tetrahedra are inside out."""
    points = shaken(0.03)
    assert (MESH.volume_ratios(points.T) < 0).mean() > 0.3
    found = descend(points, patience=3000)
    assert found.converged
    gradient = np.empty_like(points)
    energy_and_gradient(points, BODY, gradient)
    assert np.abs(gradient[:, :FREE]).max() < 1e-4


def test_steps_without_curvature_are_forgotten() -> None:
    """The ring keeps the latest steps; one that the gradient does not rise along is no use."""
    memory = empty_memory(2)
    random = np.random.default_rng(0)
    for count in range(1, MEMORY + 3):
        memory.steps[memory.cursor[1]] = random.normal(size=(3, 2))
        memory.changes[memory.cursor[1]] = 2 * memory.steps[memory.cursor[1]]
        remember(memory)
        assert memory.cursor[0] == min(count, MEMORY)
    following = memory.cursor[1]
    memory.steps[following] = 1.0
    memory.changes[following] = -1.0
    remember(memory)
    assert memory.cursor.tolist() == [MEMORY - 1, following]
    products = (memory.steps * memory.changes).sum(axis=(1, 2))
    kept = np.arange(MEMORY) != following
    np.testing.assert_allclose(memory.inverse[kept] * products[kept], 1.0)


def test_more_patience_means_less_energy() -> None:
    energies = []
    for patience in (0, 1, 2, 4, 8, 16):
        points = shaken()
        found = descend(points, patience=patience)
        assert not found.converged
        assert found.iterations == patience
        energies.append(energy_and_gradient(points, BODY, np.empty_like(points)))
    assert energies == sorted(energies, reverse=True)
    assert energies[0] > energies[-1]


def test_pinned_nodes_do_not_move() -> None:
    points = shaken()
    descend(points, patience=10)
    np.testing.assert_array_equal(points[:, FREE:], MESH.nodes[FREE:].T)


def test_what_is_not_a_number_does_not_pass_for_rest() -> None:
    points = shaken()
    points[0, 0] = np.nan
    assert not descend(points, patience=10).converged
