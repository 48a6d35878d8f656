"""However many bodies a process moves one after another, nothing of them stays."""

import gc
from collections.abc import Iterator

import numpy as np
import pytest

from dnet.sim.bullet import pybullet, start_server
from dnet.sim.soft_body import SoftBody
from dnet.sim.soft_picture import SoftPicture
from dnet.sim.tetrahedra import box_mesh

MESH = box_mesh((0.1, 0.06, 0.04), (5, 3, 2))


@pytest.fixture
def client() -> Iterator[int]:
    number = start_server()
    yield number
    pybullet.disconnect(physicsClientId=number)


def moved(client: int) -> None:
    """Load a body and a picture into an empty world, and move the nodes of both."""
    pybullet.resetSimulation(pybullet.RESET_USE_DEFORMABLE_WORLD, physicsClientId=client)
    body = SoftBody(client, MESH, young=1000.0, poisson=0.3, density=1000.0)
    where = np.array([[0.01, 0.02, 0.03]])
    body.place([7], where)
    np.testing.assert_allclose(body.nodes()[7], where[0], atol=1e-7)
    others = np.delete(np.arange(len(MESH.nodes)), 7)
    np.testing.assert_allclose(body.nodes()[others], MESH.nodes[others], atol=1e-7)
    SoftPicture(client, MESH).show(MESH.nodes)


def objects() -> int:
    gc.collect()
    return len(gc.get_objects())


def test_a_body_leaves_none_of_its_coordinates_behind(client: int) -> None:
    moved(client)
    before = objects()
    for _ in range(10):
        moved(client)
    # A body would leave a list a node, and a call would leave a list.
    assert objects() - before < 10
