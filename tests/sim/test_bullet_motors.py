"""Motors move an arm where it is sent, parallelogram and jaws along, within the URDF's limits."""

from collections.abc import Iterator

import numpy as np
import pytest

from dnet.sim.arms import Placement
from dnet.sim.bullet import pybullet, start_server
from dnet.sim.bullet_arms import BulletArms
from dnet.sim.bullet_motors import ArmMotors
from dnet.sim.psm import VELOCITY
from dnet.types import Joints

STEP = 0.008
START: Joints = np.array([0.1, -0.2, 0.1, 0.3, 0.2, -0.1])


class Bench:
    """Both arms alone in a world without gravity, with motors on both."""

    def __init__(self) -> None:
        self.client = start_server()
        pybullet.resetSimulation(pybullet.RESET_USE_DEFORMABLE_WORLD, physicsClientId=self.client)
        pybullet.setTimeStep(STEP, physicsClientId=self.client)
        self.arms = BulletArms(self.client, Placement())
        self.arms.touch_nothing()
        self.arms.show((START, START))
        self.holding, self.moving = (ArmMotors(self.client, self.arms, arm) for arm in (0, 1))
        self.holding.drive(START)

    def drive(self, joints: Joints) -> None:
        self.moving.drive(joints)
        pybullet.stepSimulation(physicsClientId=self.client)


@pytest.fixture
def bench() -> Iterator[Bench]:
    made = Bench()
    yield made
    pybullet.disconnect(physicsClientId=made.client)


def test_an_arm_is_a_step_later_where_it_is_sent(bench: Bench) -> None:
    for step in range(1, 11):
        sent = START + step * 0.5 * VELOCITY * STEP
        bench.drive(sent)
        np.testing.assert_allclose(bench.moving.joints(), sent, atol=1e-6)
    assert bench.moving.speed() == pytest.approx(0.5 * VELOCITY.max(), rel=1e-3)


def test_the_other_arm_stays(bench: Bench) -> None:
    for step in range(20):
        bench.drive(START + step * 0.5 * VELOCITY * STEP)
    np.testing.assert_allclose(bench.holding.joints(), START, atol=1e-9)
    assert bench.holding.speed() < 1e-9


def test_no_joint_is_faster_than_the_urdf_allows(bench: Bench) -> None:
    far = START + 20.5 * VELOCITY * STEP
    before, fastest = START, np.zeros(6)
    for _ in range(40):
        bench.drive(far)
        after = bench.moving.joints()
        fastest = np.maximum(fastest, np.abs(after - before) / STEP)
        before = after
    np.testing.assert_allclose(fastest, VELOCITY, rtol=1e-3)
    np.testing.assert_allclose(before, far, atol=1e-6)


def test_the_parallelogram_stays_closed_and_the_jaws_stay_open(bench: Bench) -> None:
    numbers = [number for number, _ in bench.arms.driven]
    for step in range(60):
        bench.drive(START + np.array([0.0, 0.005, 0.0, 0.0, 0.003, 0.0]) * step)
        states = pybullet.getJointStates(
            bench.arms.bodies[1], numbers, physicsClientId=bench.client
        )
        expected = [joint.position(bench.moving.joints()) for _, joint in bench.arms.driven]
        np.testing.assert_allclose([state[0] for state in states], expected, atol=1e-5)
