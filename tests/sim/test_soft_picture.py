"""The picture of a soft body is where its nodes are."""

from collections.abc import Iterator

import numpy as np
import open3d
import pytest

from dnet.geometry.camera import Camera, unproject
from dnet.sim.bullet import pybullet, start_server
from dnet.sim.bullet_eyes import depth_image
from dnet.sim.soft_picture import SoftPicture
from dnet.sim.tetrahedra import Vertices, box_mesh

MESH = box_mesh((0.1, 0.06, 0.04), (5, 3, 2))
CAMERA = Camera(width=96, height=72)


@pytest.fixture
def client() -> Iterator[int]:
    number = start_server()
    pybullet.resetSimulation(pybullet.RESET_USE_DEFORMABLE_WORLD, physicsClientId=number)
    yield number
    pybullet.disconnect(physicsClientId=number)


def shaken(seed: int) -> Vertices:
    random = np.random.default_rng(seed)
    return MESH.nodes + random.normal(scale=2e-3, size=MESH.nodes.shape)


def distance_from_surface(client: int, body: int, nodes: Vertices) -> float:
    """Of the farthest point that the camera sees of the body."""
    image = depth_image(CAMERA, client)
    cloud = unproject(image, image.mask == body)
    assert len(cloud) > 500
    surface = open3d.t.geometry.RaycastingScene()
    surface.add_triangles(
        open3d.core.Tensor.from_numpy(nodes.astype(np.float32)),
        open3d.core.Tensor.from_numpy(MESH.surface().astype(np.uint32)),
    )
    points = open3d.core.Tensor.from_numpy(cloud)
    return float(surface.compute_distance(points).numpy().max())


def test_the_picture_lies_on_the_surface_that_is_shown(client: int) -> None:
    picture = SoftPicture(client, MESH)
    for seed in range(3):
        nodes = shaken(seed)
        picture.show(nodes)
        assert distance_from_surface(client, picture.body, nodes) < 5e-5


def test_the_picture_still_follows_after_many_seconds_of_rest(client: int) -> None:
    """Bullet puts a soft body that does not move to sleep after two seconds: 480 steps."""
    picture = SoftPicture(client, MESH)
    for _ in range(1000):
        picture.show(MESH.nodes)
    nodes = shaken(3)
    picture.show(nodes)
    assert distance_from_surface(client, picture.body, nodes) < 5e-5


def test_showing_moves_nothing(client: int) -> None:
    picture = SoftPicture(client, MESH)
    nodes = shaken(4)
    picture.show(nodes)
    before = depth_image(CAMERA, client).depth
    for _ in range(10):
        picture.show(nodes)
    np.testing.assert_array_equal(depth_image(CAMERA, client).depth, before)
