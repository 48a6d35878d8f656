"""The compiled energy is the stable Neo-Hookean one, and its gradient is its derivative."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnet.sim.elastic_energy import elements, energy_and_gradient
from dnet.sim.material import Lame
from dnet.sim.tetrahedra import Vertices, box_mesh
from tests.sim.oracle import Oracle

MESH = box_mesh((0.1, 0.06, 0.04), (3, 2, 2))
MATERIAL = Lame(mu=500.0, lam=900.0)
seeds = st.integers(0, 2**32 - 1)
scales = st.sampled_from([1e-4, 1e-3, 1e-2, 1e-1])
"""From small strains to a crumpled body with half of its tetrahedra inverted."""


def compiled_energy(nodes: Vertices) -> tuple[float, Vertices]:
    points = np.ascontiguousarray(nodes.T)
    gradient = np.full_like(points, np.nan)
    energy = energy_and_gradient(points, elements(MESH, MATERIAL), gradient)
    return energy, gradient.T


def shaken(seed: int, scale: float) -> tuple[Vertices, np.random.Generator]:
    random = np.random.default_rng(seed)
    return MESH.nodes + random.normal(scale=scale, size=MESH.nodes.shape), random


@settings(max_examples=50, deadline=None)
@given(seed=seeds, scale=scales)
def test_the_gradient_is_the_derivative_of_the_energy(seed: int, scale: float) -> None:
    nodes, random = shaken(seed, scale)
    direction = random.normal(size=nodes.shape)
    step = 1e-6
    ahead, _ = compiled_energy(nodes + step * direction)
    behind, _ = compiled_energy(nodes - step * direction)
    _, gradient = compiled_energy(nodes)
    size = float(np.linalg.norm(gradient) * np.linalg.norm(direction))
    assert (ahead - behind) / (2 * step) == pytest.approx(
        float((gradient * direction).sum()), abs=1e-5 * size + 1e-9
    )


@settings(max_examples=50, deadline=None)
@given(seed=seeds, scale=scales)
def test_energy_and_gradient_agree_with_plain_numpy(seed: int, scale: float) -> None:
    nodes, _ = shaken(seed, scale)
    energy, gradient = compiled_energy(nodes)
    expected, slope = Oracle(MESH, mu=MATERIAL.mu, lam=MATERIAL.lam).energy_and_gradient(nodes)
    assert energy == pytest.approx(expected, rel=1e-9, abs=1e-15)
    np.testing.assert_allclose(gradient, slope, rtol=1e-9, atol=1e-12 * np.abs(slope).max())


def test_the_rest_shape_has_no_forces() -> None:
    _, gradient = compiled_energy(MESH.nodes)
    assert np.abs(gradient).max() < 1e-12


@settings(max_examples=20, deadline=None)
@given(seed=seeds)
def test_no_energy_depends_on_where_the_body_is_or_how_it_is_turned(seed: int) -> None:
    nodes, random = shaken(seed, 1e-3)
    turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
    turn *= np.linalg.det(turn)
    energy, gradient = compiled_energy(nodes)
    turned, turned_gradient = compiled_energy(nodes @ turn.T + random.normal(size=3))
    assert turned == pytest.approx(energy, rel=1e-9)
    np.testing.assert_allclose(turned_gradient, gradient @ turn.T, atol=1e-10)


@settings(max_examples=20, deadline=None)
@given(seed=seeds, scale=scales)
def test_forces_within_a_body_have_no_sum_and_no_moment(seed: int, scale: float) -> None:
    nodes, _ = shaken(seed, scale)
    _, gradient = compiled_energy(nodes)
    size = np.abs(gradient).max()
    np.testing.assert_allclose(gradient.sum(axis=0), 0, atol=1e-12 * size)
    np.testing.assert_allclose(np.cross(nodes, gradient).sum(axis=0), 0, atol=1e-12 * size)
