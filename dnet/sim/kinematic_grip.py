"""Arms that are exactly where they are told, with the nodes between their jaws set in place."""

from dnet.geometry.pose import inverse
from dnet.sim.arms import HOME
from dnet.sim.bullet_arms import BulletArms
from dnet.sim.psm import Psm
from dnet.sim.soft_body import NodeIndices, SoftBody
from dnet.types import Joints


class KinematicGrip:
    """A `Grip` without forces: it pins nodes, and moves those of the moving arm with its tool."""

    still = True

    def __init__(self, body: SoftBody, arms: BulletArms, *, moving: Psm) -> None:
        """Say what is gripped, by which bodies, and how the moving arm is built."""
        self._body, self._arms, self._moving = body, arms, moving
        self.joints = (HOME, HOME)

    def take(
        self, held: NodeIndices, gripped: NodeIndices, *, joints: tuple[Joints, Joints]
    ) -> None:
        """Put both arms at joint positions, and pin nodes where they lie."""
        self._body.pin(held)
        self._body.pin(gripped)
        self._gripped = gripped
        self.joints = joints
        self._jaws = self._moving.forward(joints[1])

    def release(self) -> None:
        """Let go of every node."""
        self._body.release()

    def lead(self, joints: Joints) -> None:
        """Put the moving arm at joint positions, and what it grips along with its jaws."""
        jaws = self._moving.forward(joints)
        moved = jaws @ inverse(self._jaws)
        where = self._body.nodes()[self._gripped] @ moved[:3, :3].T + moved[:3, 3]
        self._body.place(self._gripped, where)
        self._jaws = jaws
        self.joints = (self.joints[0], joints)

    def show(self) -> None:
        """Make the arms' bodies stand where the arms are: nothing else moves them."""
        self._arms.show(self.joints)
