"""Collision checks for planning: the moving arm against all that stands around it."""

import numpy as np
from jaxtyping import Bool

from dnet.geometry.camera import Camera
from dnet.sim.arm_boxes import Boxes, arm_boxes, block_boxes
from dnet.sim.arms import Placement
from dnet.sim.bullet import pybullet, start_server
from dnet.sim.bullet_arms import BulletArms
from dnet.sim.bullet_blocks import add_solid
from dnet.sim.furniture import furniture
from dnet.types import JointPath, Joints

MARGIN = 0.002
"""Distance that counts as touching, in metres; twice the spacing of checked positions."""


SLACK = 0.002
"""By which Bullet's shapes may stand out from those that it was given, in metres: to a cylinder it
adds a skin of a millimetre."""


class Clearance:
    """A copy of the scene without the object, in a Bullet server of its own."""

    def __init__(self, placement: Placement, camera: Camera, *, margin: float = MARGIN) -> None:
        """Set up the arms, the table, and the camera on its stand."""
        self._client = start_server()
        self._margin = margin
        self._placement = placement
        self._arms = BulletArms(self._client, placement)
        blocks = furniture(camera)
        self._furniture = block_boxes(blocks)
        self._blocks = {add_solid(block, self._client): f"the {block.name}" for block in blocks}
        self._holding: Boxes | None = None

    def close(self) -> None:
        """Stop the server."""
        if self._client >= 0:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = -1

    def stand(self, holding: Joints) -> None:
        """Say where the holding arm stands."""
        self._arms.show_one(0, holding)
        self._holding = arm_boxes(self._placement.arms[0], holding[None])

    def obstacle(self, joints: Joints) -> str | None:
        """Return what the moving arm touches at `joints`, and with which link; None if clear."""
        found = self.first_obstacle(joints[None])
        return None if found is None else found[1]

    def first_obstacle(self, path: JointPath) -> tuple[int, str] | None:
        """Return the first row of a path at which the moving arm touches something, and what.

        Bullet is asked only where boxes around the links come near to something.
        """
        for row in np.flatnonzero(self._suspects(path)).tolist():
            touched = self._touched(path[row])
            if touched is not None:
                return row, touched
        return None

    def _suspects(self, path: JointPath) -> Bool[np.ndarray, "_"]:
        """Return at which rows of a path Bullet must be asked."""
        boxes, reach = arm_boxes(self._placement.arms[1], path), self._margin + SLACK
        near = boxes.near(self._furniture, margin=reach).any(axis=(1, 2))
        if self._holding is None:
            return np.ones(len(path), dtype=np.bool_)
        held = Boxes(self._holding.low[0], self._holding.high[0])
        return np.asarray(near | boxes.near(held, margin=reach).any(axis=(1, 2)))

    def _touched(self, joints: Joints) -> str | None:
        self._arms.show_one(1, joints)
        for other, name in {self._arms.bodies[0]: "the holding arm", **self._blocks}.items():
            close = pybullet.getClosestPoints(
                self._arms.bodies[1], other, self._margin, physicsClientId=self._client
            )
            if close:
                return f"{name} (with its {self._arms.links.get(close[0][3], 'base_link')})"
        return None
