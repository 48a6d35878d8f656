"""The world in Bullet: exact eyes, obedient arms, repeatable shapes."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace

import numpy as np
import open3d
import pytest

from dnet.errors import EmptyGrasp, Unreachable
from dnet.geometry.camera import unproject
from dnet.sim.bullet_world import BulletSettings, BulletWorld
from dnet.sim.tissue import tissue_mesh
from dnet.types import Scene

SCENE = Scene((0.006, -0.004), 0.15, (-0.04, 0.0, 0.04), (0.04, 0.0, 0.04))


@pytest.fixture(scope="module")
def world() -> Iterator[BulletWorld]:
    with closing(BulletWorld()) as made:
        yield made


def pull(world: BulletWorld, displacement: list[float]) -> None:
    place = world.settings.placement
    start = world.joints[1]
    end = place.joints_at(1, world.tip + displacement, near=start)
    world.follow(np.array([start, end]), np.array([0.0, 0.4]))


def test_the_object_rests_where_it_is_put(world: BulletWorld) -> None:
    world.reset(SCENE)
    before = world.nodes()
    settling = world.settle()
    assert settling.settled
    assert settling.least_volume_ratio == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_allclose(world.nodes(), before, atol=1e-7)
    np.testing.assert_allclose(world.nodes().mean(axis=0), [*SCENE.position, 0.02], atol=1e-6)


def test_what_the_jaws_hold_goes_with_them_and_the_held_end_stays(world: BulletWorld) -> None:
    world.reset(SCENE)
    before, tip = world.nodes(), world.tip
    pull(world, [0.03, 0.01, 0.02])
    assert world.settle().settled
    np.testing.assert_allclose(world.tip, tip + np.array([0.03, 0.01, 0.02]), atol=1e-9)
    moved = world.nodes() - before
    jaws = np.linalg.norm(before - tip, axis=1) < world.settings.jaw_radius
    assert jaws.sum() >= 4
    np.testing.assert_allclose(
        moved[jaws], np.tile([0.03, 0.01, 0.02], (int(jaws.sum()), 1)), atol=2e-6
    )
    rest = tissue_mesh(SCENE.tissue).nodes
    end = rest[:, 0] == rest[:, 0].min()
    np.testing.assert_allclose(moved[end], 0, atol=1e-7)
    assert np.linalg.norm(moved[~jaws & ~end], axis=1).max() > 0.01


def test_restoring_brings_back_the_rest_shape_while_the_clock_goes_on(world: BulletWorld) -> None:
    world.reset(SCENE)
    before, joints = world.nodes(), world.joints
    pull(world, [0.02, -0.03, 0.03])
    world.settle()
    passed = world.time
    world.restore()
    np.testing.assert_allclose(world.nodes(), before, atol=1e-7)
    np.testing.assert_array_equal(world.joints[1], joints[1])
    world.settle()
    np.testing.assert_allclose(world.nodes(), before, atol=1e-5)
    assert world.time > passed > 0


def test_the_same_motions_give_the_same_bytes() -> None:
    """Also after another episode in the same world: a reset leaves nothing behind."""

    def shape(world: BulletWorld) -> bytes:
        world.reset(SCENE)
        pull(world, [0.02, 0.03, 0.04])
        world.settle()
        image = world.look()
        return world.nodes().tobytes() + image.depth.tobytes() + image.mask.tobytes()

    with closing(BulletWorld()) as one, closing(BulletWorld()) as other:
        first = shape(one)
        other.reset(replace(SCENE, yaw=-0.1))
        pull(other, [0.01, 0.01, 0.01])
        assert shape(other) == first
        assert shape(one) == first


def test_points_lie_on_the_surface_that_rays_meet(world: BulletWorld) -> None:
    """Every pixel of the object, against an exact ray caster: 0.05 mm at the worst."""
    world.reset(SCENE)
    pull(world, [0.02, 0.01, 0.04])
    world.settle()
    image = world.look()
    cloud = unproject(image, image.mask == world.object_id)
    surface = open3d.t.geometry.RaycastingScene()
    surface.add_triangles(
        open3d.core.Tensor.from_numpy(world.nodes()),
        open3d.core.Tensor.from_numpy(tissue_mesh(SCENE.tissue).surface().astype(np.uint32)),
    )
    distance = surface.compute_distance(open3d.core.Tensor.from_numpy(cloud)).numpy()
    assert len(cloud) > 4096
    assert distance.max() < 5e-5


def test_arms_and_object_are_told_apart_in_the_image(world: BulletWorld) -> None:
    world.reset(SCENE)
    image = world.look()
    seen, counts = np.unique(image.mask, return_counts=True)
    pixels = dict(zip(seen.tolist(), counts.tolist(), strict=True))
    assert pixels[world.object_id] > 4096
    others = [count for body, count in pixels.items() if body not in (-1, world.object_id)]
    assert len(others) >= 3, "both arms and the table are in view"
    assert min(others) > 50


def test_a_point_in_the_air_cannot_be_grasped(world: BulletWorld) -> None:
    with pytest.raises(EmptyGrasp, match=r"nearest node is .* mm away"):
        world.reset(replace(SCENE, manipulation_point=(0.09, 0.0, 0.06)))


def test_a_point_out_of_reach_cannot_be_grasped(world: BulletWorld) -> None:
    with pytest.raises(Unreachable, match="out of reach"):
        world.reset(replace(SCENE, manipulation_point=(0.6, 0.0, 0.04)))


def test_a_refused_reset_leaves_the_world_as_it_was(world: BulletWorld) -> None:
    world.reset(SCENE)
    pull(world, [0.01, 0.0, 0.01])
    before = world.nodes()
    with pytest.raises(Unreachable):
        world.reset(replace(SCENE, manipulation_point=(0.6, 0.0, 0.04)))
    np.testing.assert_array_equal(world.nodes(), before)


def test_a_body_that_does_not_come_to_rest_is_reported() -> None:
    with closing(BulletWorld(BulletSettings(tolerance=1e-12, patience=60))) as impatient:
        impatient.reset(SCENE)
        pull(impatient, [0.02, 0.0, 0.03])
        settling = impatient.settle()
    assert not settling.settled
    assert settling.steps >= 60
