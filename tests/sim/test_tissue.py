"""Objects lie on the table, and the holding arm grips their end."""

import numpy as np
import pytest

from dnet.sim.tissue import HELD_SHARE, held_nodes, hold_point, tissue_mesh
from dnet.types import Tissue

OBJECTS = (
    Tissue(),
    Tissue("box", (0.2, 0.1, 0.03), (12, 8, 3)),
    Tissue("cylinder", (0.12, 0.05, 0.05), (10, 6, 6)),
    Tissue("cylinder", (0.2, 0.03, 0.03), (11, 6, 6)),
    Tissue("hemi_ellipsoid", (0.13, 0.10, 0.04), (10, 8, 4)),
    Tissue("hemi_ellipsoid", (0.12, 0.06, 0.03), (8, 8, 4)),
)


@pytest.mark.parametrize("tissue", OBJECTS)
def test_an_object_lies_on_the_table_with_its_middle_over_the_origin(tissue: Tissue) -> None:
    nodes = tissue_mesh(tissue).nodes
    length, width, height = tissue.size
    np.testing.assert_allclose(nodes.min(axis=0), [-length / 2, -width / 2, 0], atol=1e-12)
    np.testing.assert_allclose(nodes.max(axis=0), [length / 2, width / 2, height], atol=1e-12)


@pytest.mark.parametrize("tissue", OBJECTS)
def test_the_holding_arm_grips_the_end_of_least_x(tissue: Tissue) -> None:
    nodes = tissue_mesh(tissue).nodes
    held = held_nodes(nodes)
    flat = tissue.shape != "hemi_ellipsoid"
    limit = ((0 if flat else HELD_SHARE) - 0.5) * tissue.size[0]
    assert len(held) >= 5
    assert np.all(nodes[held, 0] <= limit + 1e-9)
    rest = np.delete(nodes, held, axis=0)
    assert np.all(rest[:, 0] > limit + 1e-9)
    # Gripped by nodes on a line, an object could turn about it.
    assert np.linalg.matrix_rank(nodes[held] - nodes[held].mean(axis=0), tol=1e-3) >= 2


@pytest.mark.parametrize("tissue", OBJECTS)
def test_the_hold_is_on_top_of_the_held_end_in_the_middle(tissue: Tissue) -> None:
    nodes = tissue_mesh(tissue).nodes
    held = nodes[held_nodes(nodes)]
    hold = hold_point(tissue)
    assert np.any(np.all(held == hold, axis=1))
    assert hold[1] == 0
    assert hold[2] == held[:, 2].max()


def test_the_box_of_the_paper_is_held_at_its_end_face() -> None:
    nodes = tissue_mesh(Tissue()).nodes
    assert nodes.shape == (405, 3)
    held = held_nodes(nodes)
    assert len(held) == 45
    np.testing.assert_array_equal(nodes[held, 0], -0.05)
    np.testing.assert_allclose(hold_point(Tissue()), [-0.05, 0, 0.04])
