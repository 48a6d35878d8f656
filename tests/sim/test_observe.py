"""A frame holds one instant, its cloud and its image the same look."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from dnet.geometry.camera import Camera, DepthImage, unproject
from dnet.sim.observe import observe
from dnet.sim.world import Settling
from dnet.types import Cloud, JointPath, Joints, Nodes, Point, Scene

BODIES = np.array([[-1, 0, 1], [2, 3, -1]], np.int32)


@dataclass
class Still:
    """A world in which nothing moves: the part of one that a look takes."""

    object_id: int = 0
    time: float = 1.5
    tip: Point = field(default_factory=lambda: np.array([0.1, 0.2, 0.3]))
    joints: tuple[Joints, Joints] = field(default_factory=lambda: (np.zeros(6), np.ones(6)))

    def nodes(self) -> Nodes:
        return np.ones((4, 3), np.float32)

    def look(self) -> DepthImage:
        depth = np.linspace(0.3, 0.5, 6, dtype=np.float32).reshape(2, 3)
        return DepthImage(depth, BODIES, Camera(width=3, height=2))

    def reset(self, scene: Scene) -> None: ...

    def restore(self) -> None: ...

    def follow(self, path: JointPath, times: np.ndarray) -> None: ...

    def settle(self) -> Settling:
        return Settling(settled=True, steps=0, least_volume_ratio=1.0)

    def foresee(self, displacement: Point) -> float:
        return 1.0

    def deviation(self) -> float:
        return 0.0


def see(image: DepthImage, object_id: int) -> Cloud:
    return unproject(image, image.mask == object_id)


def farther(image: DepthImage) -> DepthImage:
    return replace(image, depth=image.depth + np.float32(0.1))


def test_a_frame_says_what_the_world_is_like() -> None:
    world = Still()
    frame = observe(world, see, "shape")
    assert (frame.time, frame.kind, frame.image) == (1.5, "shape", None)
    np.testing.assert_array_equal(frame.cloud, see(world.look(), 0))
    np.testing.assert_array_equal(frame.grasp, world.tip)
    np.testing.assert_array_equal(frame.nodes, world.nodes())
    np.testing.assert_array_equal(frame.joints, world.joints)


@pytest.mark.parametrize(
    ("object_id", "shown"),
    [
        (0, [[0, 1, 2], [3, 4, 0]]),
        (2, [[0, 2, 3], [1, 4, 0]]),
        (3, [[0, 2, 3], [4, 1, 0]]),
        (9, [[0, 2, 3], [4, 5, 0]]),
    ],
)
def test_in_an_image_the_object_is_one_and_no_two_bodies_are_the_same(
    object_id: int, shown: list[list[int]]
) -> None:
    frame = observe(Still(object_id=object_id), see, "rest", image=True)
    assert frame.image is not None
    assert frame.image.mask.tolist() == shown
    np.testing.assert_array_equal(frame.image.depth, Still().look().depth)


def test_cloud_and_image_have_the_same_noise() -> None:
    world = Still()
    frame = observe(world, see, "rest", image=True, noise=farther)
    wanted = farther(world.look())
    assert frame.image is not None
    np.testing.assert_array_equal(frame.image.depth, wanted.depth)
    np.testing.assert_array_equal(frame.cloud, see(wanted, 0))
