"""What the depth camera sees of an object of a given shape, with the arms or without them."""

import numpy as np

from dnet.geometry.camera import Camera, DepthImage
from dnet.sim.arms import Placement
from dnet.sim.bullet import pybullet, start_server
from dnet.sim.bullet_arms import BulletArms
from dnet.sim.bullet_blocks import add_picture
from dnet.sim.bullet_eyes import depth_image
from dnet.sim.furniture import TABLE
from dnet.sim.soft_picture import SoftPicture
from dnet.sim.tissue import tissue_mesh
from dnet.types import Joints, Nodes, Tissue


class Portrait:
    """Draws an object as its nodes say, in a Bullet server of its own; nothing is simulated."""

    def __init__(self, tissue: Tissue, *, camera: Camera, placement: Placement, arms: bool) -> None:
        """Set up what is drawn.

        Args:
            tissue: The object.
            camera: What looks at it.
            placement: Where the arms stand.
            arms: Whether they are in the picture.
        """
        self._camera = camera
        self._client = start_server()
        pybullet.resetSimulation(pybullet.RESET_USE_DEFORMABLE_WORLD, physicsClientId=self._client)
        self._picture = SoftPicture(self._client, tissue_mesh(tissue))
        self.object_id = self._picture.body
        """The object's number in the mask of the image."""
        self._arms = BulletArms(self._client, placement) if arms else None
        if self._arms is not None:
            self._arms.touch_nothing()
        add_picture(TABLE, self._client)

    def close(self) -> None:
        """Stop the server."""
        if self._client >= 0:
            pybullet.disconnect(physicsClientId=self._client)
            self._client = -1

    def look(self, nodes: Nodes, joints: tuple[Joints, Joints]) -> DepthImage:
        """Return what the camera sees.

        Args:
            nodes: Of the object's mesh, in metres, (n, 3).
            joints: Where the arms are.
        """
        self._picture.show(nodes.astype(np.float64))
        if self._arms is not None:
            self._arms.show(joints)
        return depth_image(self._camera, self._client)
