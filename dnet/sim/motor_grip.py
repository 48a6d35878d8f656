"""Arms driven by motors, with the nodes between their jaws anchored to their wrists."""

from dnet.sim.bullet_arms import BulletArms
from dnet.sim.bullet_motors import ArmMotors
from dnet.sim.soft_body import NodeIndices, SoftBody
from dnet.types import Joints

STILL = 1e-3
"""An arm stands still when no joint is faster than this, in rad/s or m/s."""


class MotorGrip:
    """A `Grip` with forces: the object pulls at the arms, and their motors hold against it."""

    def __init__(self, client: int, body: SoftBody, arms: BulletArms) -> None:
        """Say what is gripped, and mount motors on both arms."""
        self._body, self._arms = body, arms
        self._motors = (ArmMotors(client, arms, 0), ArmMotors(client, arms, 1))

    @property
    def joints(self) -> tuple[Joints, Joints]:
        """Where the holding and the moving arm are."""
        holding, moving = self._motors
        return holding.joints(), moving.joints()

    @property
    def still(self) -> bool:
        """Whether both arms stand still."""
        return all(motors.speed() < STILL for motors in self._motors)

    def take(
        self, held: NodeIndices, gripped: NodeIndices, *, joints: tuple[Joints, Joints]
    ) -> None:
        """Put both arms at joint positions, and anchor nodes to their wrists as they lie."""
        self._arms.show(joints)
        for arm, nodes in enumerate((held, gripped)):
            self._motors[arm].drive(joints[arm])
            self._body.anchor(
                nodes, body=self._arms.bodies[arm], link=self._motors[arm].gripping_link
            )

    def release(self) -> None:
        """Let go of every node."""
        self._body.release()

    def lead(self, joints: Joints) -> None:
        """Drive the moving arm to joint positions; the holding arm's motors hold."""
        self._motors[1].drive(joints)

    def show(self) -> None:
        """Leave the arms' bodies alone: they are the arms."""
