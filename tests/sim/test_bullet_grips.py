"""Arms that are set in place and arms that are driven there: one shape, and honest reports."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from dnet.errors import EmptyGrasp, Unreachable
from dnet.sim.bullet_world import BulletSettings, BulletWorld
from dnet.sim.scenes import Workspace, draw_displacement, draw_scene
from dnet.types import Joints, Nodes, Scene, Tissue

SCENE = Scene((0.006, -0.004), 0.15, (-0.04, 0.0, 0.04), (0.04, 0.0, 0.04))
PULL = np.array([0.02, 0.03, 0.04])


@pytest.fixture(scope="module")
def driven() -> Iterator[BulletWorld]:
    with closing(BulletWorld(BulletSettings(drive="motor"))) as made:
        yield made


def after_pull(world: BulletWorld, displacement: np.ndarray) -> Joints:
    """Return where the moving arm's joints must be for its tip to have moved."""
    joints: Joints = world.settings.placement.joints_at(
        1, world.tip + displacement, near=world.joints[1]
    )
    return joints


def move(world: BulletWorld, end: Joints, *, duration: float = 0.5) -> None:
    """Drive the moving arm, starting and ending at rest."""
    share = np.linspace(0.0, 1.0, 20)
    start = world.joints[1]
    world.follow(start + (share**2 * (3 - 2 * share))[:, None] * (end - start), duration * share)


def between_jaws(world: BulletWorld) -> np.ndarray:
    """Return which nodes the moving arm grips in a world that has just been reset to SCENE."""
    near = np.linalg.norm(world.nodes() - world.tip, axis=1) < world.settings.jaw_radius
    assert near.sum() >= 4
    return near


def test_both_ways_settle_to_the_same_shape(driven: BulletWorld) -> None:
    """Random scenes, and two random shapes of each, one after the other: 0.2 mm at the worst."""
    apart = []
    with closing(BulletWorld()) as placed:
        for seed in range(4):
            random = np.random.default_rng((9, seed))
            scene = draw_scene(Workspace(), Tissue(), random)
            try:
                for world in (placed, driven):
                    world.reset(scene)
                target = np.array(scene.manipulation_point)
                ends = [
                    after_pull(placed, target + draw_displacement(Workspace(), random) - placed.tip)
                    for _ in range(2)
                ]
            except (Unreachable, EmptyGrasp):
                continue
            for end in ends:
                for world in (placed, driven):
                    move(world, end)
                    assert world.settle().settled
                assert np.linalg.norm(driven.tip - placed.tip) < 1e-4
                apart.append(np.linalg.norm(driven.nodes() - placed.nodes(), axis=1))
    assert len(apart) >= 4
    assert max(distances.max() for distances in apart) < 2e-4


def test_nothing_jumps_when_wrists_take_hold(driven: BulletWorld) -> None:
    driven.reset(SCENE)
    before, joints = driven.nodes(), driven.joints
    assert driven.settle().settled
    np.testing.assert_allclose(driven.nodes(), before, atol=1e-7)
    np.testing.assert_allclose(driven.joints, joints, atol=1e-7)


def test_what_the_jaws_hold_keeps_its_shape_on_the_way(driven: BulletWorld) -> None:
    driven.reset(SCENE)
    jaws = between_jaws(driven)
    before, tip = driven.nodes()[jaws], driven.tip
    move(driven, after_pull(driven, PULL), duration=0.25)
    now = driven.nodes()[jaws]
    np.testing.assert_allclose(pdist(now), pdist(before), atol=1e-6)
    np.testing.assert_allclose(
        np.linalg.norm(now - driven.tip, axis=1), np.linalg.norm(before - tip, axis=1), atol=1e-5
    )


def test_an_arm_that_cannot_keep_up_says_where_it_is_and_arrives_later(
    driven: BulletWorld,
) -> None:
    driven.reset(SCENE)
    start, jaws = driven.tip, between_jaws(driven)
    before = driven.nodes()[jaws].mean(axis=0)
    move(driven, after_pull(driven, PULL), duration=0.05)
    went = driven.tip - start
    assert np.linalg.norm(PULL - went) > 0.01, "no da Vinci moves 5 cm in 50 ms"
    # The tool turns a little on the way, so its middle goes not quite as its tip.
    np.testing.assert_allclose(driven.nodes()[jaws].mean(axis=0) - before, went, atol=2e-3)
    assert driven.settle().settled
    np.testing.assert_allclose(driven.tip, start + PULL, atol=1e-4)


def test_settling_waits_for_the_arms(driven: BulletWorld) -> None:
    """With a tolerance that any motion of the object passes."""
    with closing(BulletWorld(replace(driven.settings, tolerance=1.0))) as hasty:
        hasty.reset(SCENE)
        end = after_pull(hasty, PULL)
        move(hasty, end, duration=0.05)
        assert hasty.settle().steps > hasty.settings.block + 1
        np.testing.assert_allclose(hasty.joints[1], end, atol=1e-4)


def test_restoring_brings_both_arms_and_the_object_back(driven: BulletWorld) -> None:
    driven.reset(SCENE)
    before, joints = driven.nodes(), driven.joints
    first = shape(driven)
    driven.restore()
    np.testing.assert_array_equal(driven.nodes(), before)
    np.testing.assert_array_equal(driven.joints, joints)
    # Bullet keeps a trace of what was before a `restore`; only a `reset` starts anew.
    np.testing.assert_allclose(shape(driven), first, atol=1e-6)


def shape(world: BulletWorld) -> Nodes:
    move(world, after_pull(world, PULL), duration=0.4)
    world.settle()
    return world.nodes()


def test_the_same_motions_give_the_same_bytes(driven: BulletWorld) -> None:
    """Also after another episode in the same world: a reset leaves nothing behind."""
    driven.reset(replace(SCENE, yaw=-0.1))
    shape(driven)
    driven.reset(SCENE)
    later = shape(driven), driven.joints, driven.look()
    with closing(BulletWorld(driven.settings)) as fresh:
        fresh.reset(SCENE)
        assert shape(fresh).tobytes() == later[0].tobytes()
        np.testing.assert_array_equal(fresh.joints, later[1])
        assert fresh.look().depth.tobytes() == later[2].depth.tobytes()
