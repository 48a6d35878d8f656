"""Both arms as Bullet bodies that take the joint positions they are shown."""

import tempfile
from pathlib import Path

from dnet.geometry.pose import quaternion
from dnet.sim.arms import Placement
from dnet.sim.bullet import pybullet
from dnet.sim.psm_links import LINK_JOINTS
from dnet.sim.urdf import psm_urdf
from dnet.types import Joints


class BulletArms:
    """Two arms on fixed bases."""

    def __init__(self, client: int, placement: Placement) -> None:
        """Load both arms into a Bullet server."""
        self._client = client
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "psm.urdf"
            path.write_text(psm_urdf())
            self.bodies = tuple(
                pybullet.loadURDF(
                    str(path),
                    arm.base[:3, 3].tolist(),
                    quaternion(arm.base[:3, :3]).tolist(),
                    useFixedBase=True,
                    physicsClientId=client,
                )
                for arm in placement.arms
            )
        first = self.bodies[0]
        count = pybullet.getNumJoints(first, physicsClientId=client)
        infos = [pybullet.getJointInfo(first, i, physicsClientId=client) for i in range(count)]
        numbers = {info[1].decode(): info[0] for info in infos}
        self.links = {info[0]: info[12].decode() for info in infos}
        """Link name by Bullet's number, alike for both arms; the base is -1."""
        self.driven = [(numbers[j.name], j) for j in LINK_JOINTS if j.kind != "fixed"]
        """Every joint that moves, with Bullet's number, alike for both arms."""

    def touch_nothing(self) -> None:
        """Take both arms out of contact: jaws that press on a soft body stall the solver."""
        for body in self.bodies:
            for link in (-1, *self.links):
                pybullet.setCollisionFilterGroupMask(body, link, 0, 0, physicsClientId=self._client)

    def show(self, joints: tuple[Joints, Joints]) -> None:
        """Put both arms at joint positions."""
        for arm, positions in enumerate(joints):
            self.show_one(arm, positions)

    def show_one(self, arm: int, joints: Joints) -> None:
        """Put one arm at joint positions; Bullet does not move passive joints by itself."""
        for number, joint in self.driven:
            pybullet.resetJointState(
                self.bodies[arm], number, joint.position(joints), physicsClientId=self._client
            )
