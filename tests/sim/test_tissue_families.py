"""Families draw objects within their ranges, and nothing where all objects are alike."""

from typing import get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnet.errors import TooFew
from dnet.sim.tissue import tissue_mesh
from dnet.sim.tissue_families import (
    MOST_NODES,
    SIZES,
    BoxSizes,
    CylinderSizes,
    HemiEllipsoidSizes,
    Sizes,
    TissueFamily,
)
from dnet.types import Tissue, TissueShape

SHAPES = get_args(TissueShape)
shapes = st.sampled_from(SHAPES)
seeds = st.integers(0, 2**32)


def test_the_usual_object_is_the_box_of_the_paper() -> None:
    assert TissueFamily().draw(np.random.default_rng(0)) == Tissue()


@pytest.mark.parametrize("shape", SHAPES)
def test_a_family_that_does_not_vary_draws_nothing(shape: TissueShape) -> None:
    random = np.random.default_rng(0)
    before = random.bit_generator.state
    tissue = TissueFamily(shape, young=5000.0).draw(random)
    assert random.bit_generator.state == before
    assert (tissue.shape, tissue.size, tissue.young) == (shape, SIZES[shape].usual, 5000.0)


@settings(deadline=None, max_examples=30)
@given(shape=shapes, young=st.floats(1, 1e6), seed=seeds)
def test_what_varies_depends_on_the_seed_alone(shape: TissueShape, young: float, seed: int) -> None:
    family = TissueFamily(shape, young, vary=True)
    one, same = (family.draw(np.random.default_rng(seed)) for _ in range(2))
    other = family.draw(np.random.default_rng(seed + 1))
    assert one == same
    assert one.size != other.size
    assert one.young != other.young


@settings(deadline=None, max_examples=30)
@given(shape=shapes, young=st.floats(1, 1e6), seed=seeds)
def test_objects_that_vary_can_be_simulated(shape: TissueShape, young: float, seed: int) -> None:
    tissue = TissueFamily(shape, young, vary=True).draw(np.random.default_rng(seed))
    assert tissue.shape == shape
    assert 0.4 * young <= tissue.young <= 1.6 * young
    assert abs(tissue.young - young) <= 3000
    mesh = tissue_mesh(tissue)
    assert 150 < len(mesh.nodes) <= MOST_NODES
    assert mesh.least_altitude() > 0.0015
    edges = mesh.nodes[mesh.surface()] - np.roll(mesh.nodes[mesh.surface()], 1, axis=1)
    assert np.linalg.norm(edges, axis=2).max() < 0.04, "cells are small beside the object"
    share = {"box": 1.0, "cylinder": np.pi / 4, "hemi_ellipsoid": np.pi / 6}[shape]
    volume = share * np.prod(tissue.size)
    assert 0.97 * volume < mesh.volumes(mesh.nodes).sum() <= volume * (1 + 1e-9)


@given(seed=seeds)
def test_sizes_are_drawn_within_their_ranges(seed: int) -> None:
    random = np.random.default_rng(seed)
    length, width, height = BoxSizes().draw(random)
    assert 0.07 <= width <= 0.14
    assert width <= length <= 0.21
    assert 0.028 <= height <= 0.042
    length, width, height = CylinderSizes().draw(random)
    assert 0.115 <= length <= 0.2
    assert 0.03 <= width == height <= 0.06
    length, width, height = HemiEllipsoidSizes().draw(random)
    assert 0.12 <= length <= 0.18
    assert 0.5 <= width / length <= 1
    assert 0.25 <= height / length <= 0.33


@pytest.mark.parametrize("sizes", SIZES.values())
def test_sizes_fill_their_ranges(sizes: Sizes) -> None:
    random = np.random.default_rng(0)
    drawn = np.array([sizes.draw(random) for _ in range(2000)])
    assert np.all(drawn.std(axis=0) > 0.06 * drawn.mean(axis=0))


@pytest.mark.parametrize(("young", "deviation"), [(1e3, 200.0), (5e3, 1e3), (1e4, 1e3)])
def test_stiffness_is_spread_as_in_the_paper(young: float, deviation: float) -> None:
    random = np.random.default_rng(0)
    family = TissueFamily("box", young, vary=True)
    drawn = np.array([family.draw(random).young for _ in range(400)])
    assert drawn.mean() == pytest.approx(young, abs=0.2 * deviation)
    assert drawn.std() == pytest.approx(deviation, rel=0.1)


@pytest.mark.parametrize("young", [0.0, -1000.0, float("nan")])
def test_an_object_without_stiffness_is_refused(young: float) -> None:
    with pytest.raises(TooFew, match="Young's modulus in pascals is"):
        TissueFamily(young=young)
