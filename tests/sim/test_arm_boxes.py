"""Boxes around the arm's links hold the links as Bullet has them."""

import numpy as np

from dnet.geometry.camera import Camera
from dnet.sim.arm_boxes import Boxes, arm_boxes, block_boxes
from dnet.sim.arms import Placement
from dnet.sim.bullet import pybullet, start_server
from dnet.sim.bullet_arms import BulletArms
from dnet.sim.bullet_blocks import add_solid
from dnet.sim.clearance import SLACK
from dnet.sim.furniture import TABLE, Block, furniture
from dnet.sim.psm import LOWER, UPPER

PLACE = Placement()


def test_no_link_stands_out_of_its_box_by_more_than_bullets_skin() -> None:
    """Measured by Bullet down to a floor, to which the lowest point of each link is nearest."""
    client = start_server()
    arms = BulletArms(client, PLACE)
    floor = add_solid(Block("floor", "box", (9.0, 9.0, 1.0), (0.0, 0.0, -1.5)), client)
    random = np.random.default_rng(0)
    path = np.stack([random.uniform(LOWER, UPPER) for _ in range(50)])
    boxes = arm_boxes(PLACE.arms[1], path)
    for low, joints in zip(boxes.low, path, strict=True):
        arms.show_one(1, joints)
        found = pybullet.getClosestPoints(arms.bodies[1], floor, 9.0, physicsClientId=client)
        heights: dict[int, float] = {}
        for point in found:
            heights[point[3]] = min(point[8] - 1.0, heights.get(point[3], np.inf))
        assert len(heights) == len(low)
        # The links come in another order in Bullet: the lowest belongs to the lowest.
        measured, boxed = np.sort(list(heights.values())), np.sort(low[:, 2])
        assert (measured > boxed - SLACK).all()
        # Nor are the boxes much larger than they must be.
        assert (measured < boxed + 0.01).all()
    pybullet.disconnect(physicsClientId=client)


def test_boxes_are_near_when_they_are_so_along_every_axis() -> None:
    one = Boxes(np.zeros((1, 3)), np.ones((1, 3)))
    others = Boxes(np.array([[1.5, 0, 0], [1.5, 1.5, 0], [1.5, 2.5, 0]]), np.full((3, 3), 3.0))
    np.testing.assert_array_equal(one.near(others, margin=0.4), [[False, False, False]])
    np.testing.assert_array_equal(one.near(others, margin=0.6), [[True, True, False]])


def test_blocks_are_their_own_boxes() -> None:
    blocks = furniture(Camera())
    table = blocks.index(TABLE)
    boxes = block_boxes(blocks)
    np.testing.assert_allclose(boxes.high[table], [0.3, 0.3, 0.0], atol=1e-12)
    np.testing.assert_allclose(boxes.low[table], [-0.3, -0.3, -0.04], atol=1e-12)
