"""The arm's kinematics are consistent with themselves and with Bullet's."""

import re
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from dnet.errors import Unreachable
from dnet.geometry.pose import pose, rotation_x, rotation_z
from dnet.sim.arms import ArmModel, Placement
from dnet.sim.bullet import pybullet, quiet, start_server
from dnet.sim.psm import JOINT_NAMES, LOWER, TIP, UPPER, Psm
from dnet.sim.psm_links import LINK_JOINTS, link_frames
from dnet.sim.urdf import psm_urdf
from dnet.types import ARMS

ARM = Psm(pose(rotation_z(0.7) @ rotation_x(0.2), np.array([0.1, -0.2, 0.3])))

shares = hnp.arrays(np.float64, 6, elements=st.floats(0.0, 1.0))


@settings(deadline=None)
@given(share=shares)
def test_inverse_kinematics_round_trips(share: np.ndarray) -> None:
    joints = LOWER + share * (UPPER - LOWER)
    # Shallower than this the wrist is inside the cannula, which the inverse refuses.
    joints[2] = 0.065 + share[2] * (UPPER[2] - 0.065)
    tip = ARM.forward(joints)
    found = ARM.inverse(tip, near=joints)
    np.testing.assert_allclose(ARM.forward(found), tip, atol=1e-9)
    assert np.all(found >= LOWER - 1e-9)
    assert np.all(found <= UPPER + 1e-9)


@settings(deadline=None, max_examples=40)
@given(share=shares)
def test_poses_that_follow_each_other_are_solved_as_one_after_the_other(share: np.ndarray) -> None:
    first = LOWER + share * (UPPER - LOWER)
    first[2] = 0.065 + share[2] * (UPPER[2] - 0.065)
    # On the way one joint leaves its limits.
    path = first + np.linspace(0.0, 1.2, 7)[:, None] * np.array([0.4, 0.2, 0.05, 3.0, 0.3, -0.3])
    tips = ARM.forward_along(path)
    np.testing.assert_array_equal(tips, [ARM.forward(joints) for joints in path])
    together, fault = ARM.inverse_along(tips, near=first)
    near = first
    for tip, found in zip(tips, together, strict=False):
        near = ARM.inverse(tip, near=near)
        np.testing.assert_allclose(found, near, atol=1e-12)
    if fault is None:
        assert len(together) == len(tips)
    else:
        with pytest.raises(Unreachable, match=re.escape(str(fault))):
            ARM.inverse(tips[len(together)], near=near)


def test_a_pose_without_a_direction_is_out_of_reach() -> None:
    tip = ARM.base @ pose(np.eye(3), np.array([0.0, 0.0, 0.1])) @ TIP
    with pytest.raises(Unreachable, match="the wrist-yaw axis runs through the base"):
        ARM.inverse(tip, near=np.zeros(6))


def test_the_roll_stays_on_the_branch_it_is_on() -> None:
    joints = np.array([0.1, -0.2, 0.15, 4.0, 0.3, -0.2])
    np.testing.assert_allclose(ARM.inverse(ARM.forward(joints), near=joints), joints, atol=1e-9)


def test_a_wrist_in_the_cannula_is_out_of_reach() -> None:
    with pytest.raises(Unreachable, match="remote centre of motion, must be at least 45 mm"):
        ARM.inverse(ARM.forward(np.array([0.0, 0, 0.02, 0, 0, 0])), near=np.zeros(6))


def test_a_joint_beyond_its_limit_is_named() -> None:
    joints = np.array([0.0, 0.0, 0.3, 0.0, 0.0, 0.0])
    with pytest.raises(Unreachable, match=r"insertion would be 0\.300, limits 0\.000 to 0\.240"):
        ARM.inverse(ARM.forward(joints), near=joints)


def test_bullet_agrees_with_the_chain(tmp_path: Path) -> None:
    path = tmp_path / "psm.urdf"
    path.write_text(psm_urdf())
    client = start_server()
    body = pybullet.loadURDF(str(path), useFixedBase=True, physicsClientId=client)
    count = pybullet.getNumJoints(body, physicsClientId=client)
    numbers = {
        pybullet.getJointInfo(body, i, physicsClientId=client)[1].decode(): i for i in range(count)
    }
    random = np.random.default_rng(0)
    arm, worst = Psm(np.eye(4)), 0.0
    for _ in range(1000):
        joints = random.uniform(LOWER, UPPER)
        for link in LINK_JOINTS:
            if link.kind != "fixed":
                pybullet.resetJointState(
                    body, numbers[link.name], link.position(joints), physicsClientId=client
                )
        state = pybullet.getLinkState(
            body, numbers["tip"], computeForwardKinematics=True, physicsClientId=client
        )
        worst = max(worst, float(np.abs(arm.forward(joints)[:3, 3] - state[4]).max()))
    pybullet.disconnect(physicsClientId=client)
    print(f"worst position error {worst:.1e} m")
    assert worst < 1e-6


def test_bullet_loads_the_urdf_without_a_word(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Bullet tells of missing inertias, colours and meshes on its standard streams."""
    path = tmp_path / "psm.urdf"
    path.write_text(psm_urdf())
    with quiet():
        client = start_server()
    pybullet.loadURDF(str(path), physicsClientId=client)
    captured = capfd.readouterr()
    with quiet():
        pybullet.disconnect(physicsClientId=client)
    assert captured.out + captured.err == ""


def test_every_link_has_a_mass_and_every_joint_a_parent() -> None:
    robot = ElementTree.fromstring(psm_urdf())
    links = {link.get("name") for link in robot.findall("link")}
    for link in robot.findall("link"):
        mass = link.find("inertial/mass")
        assert mass is not None
        assert float(mass.get("value", "0")) > 0
    children = [joint.find("child") for joint in robot.findall("joint")]
    named = {child.get("link") for child in children if child is not None}
    assert named | {"base_link"} == links


def test_the_parallelogram_keeps_its_bar_parallel() -> None:
    """However far the arm pitches, the bar stays square to the yaw axis and reaches the rail."""
    names = [joint.name for joint in LINK_JOINTS]
    path = np.array([[0.3, pitch, 0.1, 0, 0, 0] for pitch in (-0.8, 0.0, 0.5)])
    for frames in link_frames(path):
        back = frames[names.index("pitch_back")]
        bar = back @ frames[names.index("pitch_bar")]
        rail = frames[names.index("pitch")]
        np.testing.assert_allclose(np.abs(bar[:3, 0]), [0, 0, 1], atol=1e-12)
        np.testing.assert_allclose(back[:3, :3], rail[:3, :3], atol=1e-12)


def test_link_frames_lead_from_the_world_to_the_tips() -> None:
    placement = Placement()
    model = ArmModel(placement)
    joints = (
        placement.joints_at(0, np.array([-0.045, 0.0, 0.04])),
        placement.joints_at(1, np.array([0.05, 0.02, 0.05])),
    )
    entries = {entry.child: entry for entry in model.transforms(joints)}
    assert len(entries) == len(ARMS) * (len(LINK_JOINTS) + 1)
    for name, expected in zip(ARMS, ([-0.045, 0.0, 0.04], [0.05, 0.02, 0.05]), strict=True):
        child, matrix = f"{name}/tip_link", np.eye(4)
        while child != "world":
            entry = entries[child]
            x, y, z, w = entry.rotation
            rotation = np.array(pybullet.getMatrixFromQuaternion([x, y, z, w])).reshape(3, 3)
            matrix = pose(rotation, entry.translation) @ matrix
            child = entry.parent
        np.testing.assert_allclose(matrix[:3, 3], expected, atol=1e-9)
    np.testing.assert_allclose(model.tips(joints[1][None]), [[0.05, 0.02, 0.05]], atol=1e-12)


def test_the_moving_arm_on_its_way_is_where_its_links_are_at_each_time() -> None:
    placement = Placement()
    model = ArmModel(placement)
    holding = placement.joints_at(0, np.array([-0.045, 0.0, 0.04]))
    first, last = (placement.joints_at(1, np.array([0.05, y, 0.05])) for y in (-0.03, 0.03))
    path = np.linspace(first, last, 5)
    way = model.way(path)
    assert all(child.startswith(ARMS[1]) for _, child in way.names)
    before = model.transforms((holding, path[0]))
    for row, joints in enumerate(path):
        entries = model.transforms((holding, joints))
        moved = dict(zip(way.names, way.translations[row], strict=True))
        turned = dict(zip(way.names, way.rotations[row], strict=True))
        for entry, earlier in zip(entries, before, strict=True):
            key = entry.parent, entry.child
            if key in moved:
                np.testing.assert_allclose(moved[key], entry.translation, atol=1e-12)
                np.testing.assert_allclose(turned[key], entry.rotation, atol=1e-12)
            else:
                np.testing.assert_array_equal(entry.translation, earlier.translation)
                np.testing.assert_array_equal(entry.rotation, earlier.rotation)
    tips = np.linspace([0.05, -0.03, 0.05], [0.05, 0.03, 0.05], 2)
    np.testing.assert_allclose(model.tips(np.stack([first, last])), tips, atol=1e-9)


def test_the_tool_keeps_its_orientation_wherever_it_goes() -> None:
    placement = Placement()
    tips = [np.array([0.045, y, 0.05]) for y in (-0.05, 0.0, 0.05)]
    poses = [placement.arms[1].forward(placement.joints_at(1, tip)) for tip in tips]
    for one, other in pairwise(poses):
        np.testing.assert_allclose(one[:3, :3], other[:3, :3], atol=1e-12)


def test_every_joint_has_a_name_of_its_own() -> None:
    assert len(set(JOINT_NAMES)) == len(LOWER) == 6
