"""Collision checks for planning: the moving arm against all that stands around it."""

from dnet.geometry.camera import Camera
from dnet.sim.arms import Placement
from dnet.sim.bullet import pybullet
from dnet.sim.bullet_arms import BulletArms
from dnet.sim.bullet_blocks import add_solid
from dnet.sim.furniture import furniture
from dnet.types import Joints

MARGIN = 0.002
"""Distance that counts as touching, in metres; twice the spacing of checked positions."""


class Clearance:
    """A copy of the scene without the object, in a Bullet server of its own."""

    def __init__(self, placement: Placement, camera: Camera, *, margin: float = MARGIN) -> None:
        """Set up the arms, the table, and the camera on its stand."""
        self._client: int = pybullet.connect(pybullet.DIRECT)
        self._margin = margin
        self._arms = BulletArms(self._client, placement)
        self._others = {self._arms.bodies[0]: "the holding arm"}
        for block in furniture(camera):
            self._others[add_solid(block, self._client)] = f"the {block.name}"

    def close(self) -> None:
        """Stop the server."""
        if self._client >= 0:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = -1

    def stand(self, holding: Joints) -> None:
        """Say where the holding arm stands."""
        self._arms.show_one(0, holding)

    def obstacle(self, joints: Joints) -> str | None:
        """Return what the moving arm touches at `joints`, and with which link; None if clear."""
        self._arms.show_one(1, joints)
        for other, name in self._others.items():
            close = pybullet.getClosestPoints(
                self._arms.bodies[1], other, self._margin, physicsClientId=self._client
            )
            if close:
                return f"{name} (with its {self._arms.links.get(close[0][3], 'base_link')})"
        return None
