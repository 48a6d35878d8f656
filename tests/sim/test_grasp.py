"""A scene says where everything starts, and the jaws grip what is near to them."""

from dataclasses import replace

import numpy as np
import pytest

from dnet.errors import EmptyGrasp, Unreachable
from dnet.geometry.pose import rotation_z
from dnet.sim.arms import Placement
from dnet.sim.grasp import grasp
from dnet.types import Scene

SCENE = Scene((0.006, -0.004), 0.15, (-0.04, 0.0, 0.04), (0.04, 0.0, 0.04))


def test_the_object_lies_on_the_table_where_the_scene_says() -> None:
    rest = grasp(SCENE, Placement()).rest
    assert rest[:, 2].min() == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(rest.mean(axis=0), [*SCENE.position, 0.02], atol=1e-12)


def test_the_arms_are_at_their_points() -> None:
    start = grasp(SCENE, Placement())
    for arm, joints, point in zip(
        Placement().arms, start.joints, (SCENE.hold, SCENE.manipulation_point), strict=True
    ):
        np.testing.assert_allclose(arm.forward(joints)[:3, 3], point, atol=1e-9)


@pytest.mark.parametrize("radius", [0.016, 0.03, 0.2])
def test_the_jaws_grip_what_is_near_and_not_held_already(radius: float) -> None:
    start = grasp(SCENE, Placement(), jaw_radius=radius)
    distance = np.linalg.norm(start.rest - SCENE.manipulation_point, axis=1)
    gripped = np.zeros(len(start.rest), bool)
    gripped[start.gripped] = True
    held = np.isin(np.arange(len(start.rest)), start.held)
    np.testing.assert_array_equal(gripped, (distance < radius) & ~held)
    assert len(np.unique(start.pinned)) == len(start.pinned)


def test_the_held_nodes_are_those_of_the_end_at_least_x_of_the_object() -> None:
    start = grasp(replace(SCENE, yaw=-0.2), Placement())
    own = (start.rest - [*SCENE.position, 0.0]) @ rotation_z(-0.2)
    held = np.isin(np.arange(len(own)), start.held)
    assert own[held, 0].max() < own[~held, 0].min()
    assert own[held, 0].min() == pytest.approx(-0.05)


def test_a_point_in_the_air_cannot_be_grasped() -> None:
    with pytest.raises(EmptyGrasp, match=r"nearest node is .* mm away"):
        grasp(replace(SCENE, manipulation_point=(0.09, 0.0, 0.06)), Placement())


def test_a_point_out_of_reach_cannot_be_grasped() -> None:
    with pytest.raises(Unreachable, match="out of reach"):
        grasp(replace(SCENE, manipulation_point=(0.6, 0.0, 0.04)), Placement())
