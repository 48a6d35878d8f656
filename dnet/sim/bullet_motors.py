"""The position motors of one arm in Bullet, within the URDF's limits of force and velocity."""

import numpy as np

from dnet.sim.bullet import pybullet
from dnet.sim.bullet_arms import BulletArms
from dnet.sim.psm import JOINT_NAMES
from dnet.types import Joints

GRIPPING_LINK = "wrist_yaw_link"
"""The link that both jaws hang on: what they grip goes with it."""
GRIPPING_MASS = 2.0
"""Of the gripping link, in kg. Bullet's motors and anchors see each other's impulses only from one
step to the next; in between, a pull f moves a link of mass m by f dt^2 / m. The wrist's own 12 g
would give way to the softest tissue. What a real arm has against that are the rotors of its
motors, whose inertia counts with the square of the gear ratio."""
GRIPPING_INERTIA = 0.01
"""Of the gripping link about each axis, in kg m^2: the same for its turning."""


class ArmMotors:
    """A motor on every joint of an arm; those on the jaws and the parallelogram follow the chain.

    A motor closes its joint's whole error within a step, unless that takes more than the URDF's
    force or velocity.
    """

    def __init__(self, client: int, arms: BulletArms, arm: int) -> None:
        """Mount the motors on one of the arms; none turns before it is driven."""
        self._client, self._body = client, arms.bodies[arm]
        self.gripping_link = next(
            number for number, name in arms.links.items() if name == GRIPPING_LINK
        )
        """Bullet's number of the link that what is gripped goes with."""
        infos = [
            pybullet.getJointInfo(self._body, number, physicsClientId=client)
            for number, _ in arms.driven
        ]
        self._motors = [
            (number, joint, info[10], info[11])
            for (number, joint), info in zip(arms.driven, infos, strict=True)
        ]
        numbers = {joint.name: number for number, joint in arms.driven}
        self._chain = [numbers[name] for name in JOINT_NAMES]
        pybullet.changeDynamics(
            self._body,
            self.gripping_link,
            mass=GRIPPING_MASS,
            localInertiaDiagonal=[GRIPPING_INERTIA] * 3,
            physicsClientId=client,
        )

    def drive(self, joints: Joints) -> None:
        """Have the arm go to joint positions, in the next step if its limits allow."""
        for number, joint, force, velocity in self._motors:
            pybullet.setJointMotorControl2(
                self._body,
                number,
                pybullet.POSITION_CONTROL,
                targetPosition=joint.position(joints),
                positionGain=1.0,
                velocityGain=1.0,
                force=force,
                maxVelocity=velocity,
                physicsClientId=self._client,
            )

    def joints(self) -> Joints:
        """Return where the arm is."""
        return np.array([state[0] for state in self._states()])

    def speed(self) -> float:
        """Return the speed of the fastest joint, in rad/s or m/s."""
        return max(abs(state[1]) for state in self._states())

    def _states(self) -> list[tuple[float, float]]:
        states = pybullet.getJointStates(self._body, self._chain, physicsClientId=self._client)
        return [(state[0], state[1]) for state in states]
