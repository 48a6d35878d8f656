"""An object that is let go of goes back to rest, and can be grasped elsewhere; in both worlds."""

from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest

from dnet.errors import EmptyGrasp
from dnet.sim.arms import Placement
from dnet.sim.bullet_world import BulletWorld
from dnet.sim.quasistatic_world import QuasistaticWorld
from dnet.sim.world import GraspingWorld
from dnet.types import Scene

SCENE = Scene((0.006, -0.004), 0.15, (-0.04, 0.0, 0.04), (0.04, 0.0, 0.04))
CRUSHING = np.array([-0.08, 0.0, -0.04])
ELSEWHERE = np.array([0.03, 0.03, 0.04])


@pytest.fixture(scope="module", params=[QuasistaticWorld, BulletWorld])
def world(request: pytest.FixtureRequest) -> Iterator[GraspingWorld]:
    with closing(request.param()) as made:
        yield made


def pull(world: GraspingWorld, displacement: list[float]) -> None:
    start = world.joints[1]
    end = Placement().joints_at(1, world.tip + displacement, near=start)
    world.follow(np.array([start, end]), np.array([0.0, 0.4]))
    world.settle()


def test_what_is_held_does_not_slip(world: GraspingWorld) -> None:
    assert isinstance(world, GraspingWorld)
    world.reset(SCENE)
    pull(world, [0.02, 0.01, 0.02])
    assert world.slip() < 1e-4


def test_what_is_let_go_of_returns_to_rest_while_the_arm_stays(world: GraspingWorld) -> None:
    world.reset(SCENE)
    rest = world.nodes()
    pull(world, [0.02, 0.01, 0.02])
    assert np.abs(world.nodes() - rest).max() > 0.01
    tip = world.tip
    world.release()
    world.settle()
    assert world.slip() == float("inf")
    np.testing.assert_allclose(world.tip, tip, atol=1e-9)
    assert np.linalg.norm(world.nodes() - rest, axis=1).mean() < 1e-3
    pull(world, [0.0, 0.0, 0.02])
    assert np.linalg.norm(world.nodes() - rest, axis=1).mean() < 1e-3


def test_what_is_grasped_elsewhere_goes_along_there(world: GraspingWorld) -> None:
    world.reset(SCENE)
    rest, time = world.nodes(), world.time
    world.release()
    world.regrasp(ELSEWHERE)
    np.testing.assert_allclose(world.tip, ELSEWHERE, atol=1e-9)
    np.testing.assert_allclose(world.nodes(), rest, atol=1e-6)
    assert world.time >= time
    near = np.linalg.norm(rest - ELSEWHERE, axis=1) < 0.016
    pull(world, [0.0, 0.0, 0.02])
    moved = world.nodes() - rest
    np.testing.assert_allclose(moved[near], np.tile([0.0, 0.0, 0.02], (near.sum(), 1)), atol=1e-4)
    assert world.slip() < 1e-4
    assert world.deviation() < 5e-3


def test_where_there_is_no_tissue_nothing_is_grasped(world: GraspingWorld) -> None:
    world.reset(SCENE)
    tip = world.tip
    with pytest.raises(EmptyGrasp):
        world.regrasp(np.array([0.09, 0.0, 0.06]))
    np.testing.assert_array_equal(world.tip, tip)
    assert world.slip() < 1e-4


def test_both_worlds_bear_the_same(world: GraspingWorld) -> None:
    """To within the hundredths of a millimetre to which Bullet settles."""
    world.reset(SCENE)
    pull(world, [0.02, 0.01, 0.02])
    assert world.borne(np.array([0.0, 0.0, 0.01])) == 1.0
    assert world.borne(CRUSHING) == pytest.approx(0.688, abs=0.01)


def test_with_open_jaws_any_motion_is_borne(world: GraspingWorld) -> None:
    world.reset(SCENE)
    world.release()
    assert world.borne(CRUSHING) == 1.0
