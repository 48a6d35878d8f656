"""Furniture as Bullet bodies: to bump into, or only to be seen."""

from dnet.sim.bullet import pybullet
from dnet.sim.furniture import Block

COLOUR = (0.70, 0.74, 0.70, 1.0)


def add_solid(block: Block, client: int) -> int:
    """Add a block that can be touched, and return its number."""
    if block.shape == "box":
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_BOX,
            halfExtents=[edge / 2 for edge in block.size],
            physicsClientId=client,
        )
    else:
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_CYLINDER,
            radius=block.size[0] / 2,
            height=block.size[2],
            physicsClientId=client,
        )
    return pybullet.createMultiBody(
        baseCollisionShapeIndex=shape, basePosition=block.centre, physicsClientId=client
    )


def add_picture(block: Block, client: int) -> int:
    """Add a box that is only seen: contact with a soft body costs ten times the step."""
    shape = pybullet.createVisualShape(
        pybullet.GEOM_BOX,
        halfExtents=[edge / 2 for edge in block.size],
        rgbaColor=COLOUR,
        physicsClientId=client,
    )
    return pybullet.createMultiBody(
        baseVisualShapeIndex=shape, basePosition=block.centre, physicsClientId=client
    )
