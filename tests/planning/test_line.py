"""The straight line of the tip is straight, and ends where something ends it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from dnet.errors import Unreachable
from dnet.planning.line import SPACING, straight_line
from dnet.sim.psm import Psm
from dnet.types import JointPath, Joints, Poses
from tests.planning.arms import ARM, START, Boxes, tip, wall

displacements = hnp.arrays(np.float64, 3, elements=st.floats(-0.04, 0.04))


@settings(deadline=None, max_examples=25)
@given(displacement=displacements)
def test_the_tip_moves_straight_and_keeps_its_orientation(displacement: np.ndarray) -> None:
    line = straight_line(ARM, Boxes().first_obstacle, START, displacement)
    assert line.fraction == 1.0
    poses = np.array([ARM.forward(joints) for joints in line.path])
    shares = np.linspace(0, 1, len(poses))
    np.testing.assert_allclose(
        poses[:, :3, 3], tip(START) + shares[:, None] * displacement, atol=1e-9
    )
    np.testing.assert_allclose(
        poses[:, :3, :3], np.tile(poses[0, :3, :3], (len(poses), 1, 1)), atol=1e-9
    )
    steps = np.linalg.norm(np.diff(poses[:, :3, 3], axis=0), axis=1)
    assert steps.max() <= SPACING * (1 + 1e-6)


def test_a_wall_ends_it_in_front_of_the_wall() -> None:
    line = straight_line(ARM, wall(0.025).first_obstacle, START, np.array([-0.04, 0.0, 0.0]))
    assert line.stop == "a box"
    assert 0.025 + 0.002 <= tip(line.path[-1])[0] < 0.025 + 0.002 + 2 * SPACING
    assert line.fraction == pytest.approx((0.045 - tip(line.path[-1])[0]) / 0.04)


def test_the_end_of_the_workspace_ends_it_with_a_reason() -> None:
    line = straight_line(ARM, Boxes().first_obstacle, START, np.array([0.0, 0.4, 0.0]))
    assert 0 < line.fraction < 1
    assert "out of reach" in line.stop


def test_a_jump_of_the_joints_ends_it_before_the_jump() -> None:
    class Jumping(Psm):
        """An arm whose inverse kinematics turn to another branch half-way."""

        def inverse_along(
            self, tips: Poses, *, near: Joints
        ) -> tuple[JointPath, Unreachable | None]:
            path, fault = super().inverse_along(tips, near=near)
            path[len(path) // 2 :, 3] += 2 * np.pi
            return path, fault

    arm = Jumping(ARM.base)
    line = straight_line(arm, Boxes().first_obstacle, START, np.array([0.0, 0.02, 0.0]))
    assert line.stop == "the joints would jump by 75 mm of tip motion"
    assert line.fraction == 0.5
    assert len(line.path) == 11


def test_no_displacement_is_a_whole_line() -> None:
    line = straight_line(ARM, Boxes().first_obstacle, START, np.zeros(3))
    assert line.fraction == 1.0
    np.testing.assert_allclose(line.path[-1], START, atol=1e-9)
