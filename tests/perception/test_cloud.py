"""The cloud holds the object and nothing but the object."""

import numpy as np
import pytest

from dnet.errors import ShortCloud
from dnet.geometry.camera import Camera, DepthImage, unproject
from dnet.perception.cloud import object_cloud

CAMERA = Camera(width=64, height=48)
OBJECT, ROBOT, NOTHING = 0, 1, -1


def image() -> DepthImage:
    mask = np.full((48, 64), NOTHING, np.int32)
    mask[10:30, 20:50] = OBJECT
    mask[15:20, 30:40] = ROBOT
    depth = np.random.default_rng(0).uniform(0.4, 0.5, (48, 64)).astype(np.float32)
    return DepthImage(depth, mask, CAMERA)


def test_every_point_is_one_of_the_objects_pixels() -> None:
    seen = image()
    whole = {tuple(point) for point in unproject(seen, seen.mask == OBJECT)}
    cloud = object_cloud(seen, OBJECT, points=200)
    assert cloud.shape == (200, 3)
    assert cloud.dtype == np.float32
    assert {tuple(point) for point in cloud} <= whole


def test_the_object_out_of_view_is_an_error_that_says_so() -> None:
    with pytest.raises(
        ShortCloud, match=r"cloud has 550 points, need at least 2048; is the object"
    ):
        object_cloud(image(), OBJECT)
    with pytest.raises(ShortCloud, match="cloud has 0 points"):
        object_cloud(image(), 7, points=16)
