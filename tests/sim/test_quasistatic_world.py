"""The world without inertia does what the world in Bullet does, at once."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace

import numpy as np
import open3d
import pytest

from dnet.errors import Unreachable
from dnet.geometry.camera import unproject
from dnet.sim.arms import Placement
from dnet.sim.bullet_world import BulletWorld
from dnet.sim.quasistatic_world import QuasistaticWorld
from dnet.sim.scenes import Workspace, draw_displacement, draw_scene
from dnet.sim.tissue import held_nodes, tissue_mesh
from dnet.sim.world import World
from dnet.types import Scene, Tissue

SCENE = Scene((0.006, -0.004), 0.15, (-0.04, 0.0, 0.04), (0.04, 0.0, 0.04))
MESH = tissue_mesh(SCENE.tissue)


@pytest.fixture(scope="module")
def world() -> Iterator[QuasistaticWorld]:
    with closing(QuasistaticWorld()) as made:
        yield made


def pull(world: World, displacement: list[float] | np.ndarray, *, seconds: float = 0.4) -> None:
    start = world.joints[1]
    end = Placement().joints_at(1, world.tip + displacement, near=start)
    world.follow(np.array([start, end]), np.array([0.0, seconds]))


def test_it_is_a_world(world: QuasistaticWorld) -> None:
    assert isinstance(world, World)


def test_the_object_rests_where_it_is_put(world: QuasistaticWorld) -> None:
    world.reset(SCENE)
    before = world.nodes()
    settling = world.settle()
    assert settling.settled
    assert settling.least_volume_ratio == pytest.approx(1.0, abs=1e-6)
    assert world.deviation() < 1e-6
    np.testing.assert_array_equal(world.nodes(), before)
    np.testing.assert_allclose(world.nodes().mean(axis=0), [*SCENE.position, 0.02], atol=1e-6)


def test_what_the_jaws_hold_goes_with_them_and_the_held_end_stays(
    world: QuasistaticWorld,
) -> None:
    world.reset(SCENE)
    before, tip = world.nodes(), world.tip
    pull(world, [0.03, 0.01, 0.02])
    settling = world.settle()
    assert settling.settled
    assert settling.steps > 0
    np.testing.assert_allclose(world.tip, tip + np.array([0.03, 0.01, 0.02]), atol=1e-9)
    moved = world.nodes() - before
    jaws = np.linalg.norm(before - tip, axis=1) < 0.016
    assert jaws.sum() >= 4
    np.testing.assert_allclose(
        moved[jaws], np.tile([0.03, 0.01, 0.02], (int(jaws.sum()), 1)), atol=2e-6
    )
    end = np.isin(np.arange(len(moved)), held_nodes(MESH.nodes))
    np.testing.assert_allclose(moved[end], 0, atol=1e-7)
    assert np.linalg.norm(moved[~jaws & ~end], axis=1).max() > 0.01


@pytest.mark.parametrize("seed", range(4))
def test_shapes_are_those_to_which_bullet_settles(world: QuasistaticWorld, seed: int) -> None:
    random = np.random.default_rng(seed)
    scene = draw_scene(Workspace(), Tissue(), random)
    displacement = draw_displacement(Workspace(), random)
    with closing(BulletWorld()) as bullet:
        for each in (bullet, world):
            each.reset(scene)
            pull(each, displacement)
            assert each.settle().settled
        expected = bullet.nodes()
    error = np.linalg.norm(world.nodes() - expected, axis=1)
    print(f"mean {error.mean() * 1e3:.3f} mm, worst {error.max() * 1e3:.3f} mm")
    assert error.mean() < 0.2e-3
    assert np.abs(expected - world.nodes()).max() < 2e-3


def test_both_worlds_look_alike(world: QuasistaticWorld) -> None:
    """The same camera, arms and table: the same picture of the same shape."""
    with closing(BulletWorld()) as bullet:
        bullet.reset(SCENE)
        expected = bullet.look()
        owner = bullet.object_id
    world.reset(SCENE)
    image = world.look()
    assert image.camera == expected.camera
    np.testing.assert_array_equal(image.mask == world.object_id, expected.mask == owner)
    np.testing.assert_allclose(image.depth, expected.depth, atol=1e-5)


def test_points_lie_on_the_surface_that_rays_meet(world: QuasistaticWorld) -> None:
    """Every pixel of the object, against an exact ray caster: 0.05 mm at the worst."""
    world.reset(SCENE)
    pull(world, [0.02, 0.01, 0.04])
    image = world.look()
    cloud = unproject(image, image.mask == world.object_id)
    surface = open3d.t.geometry.RaycastingScene()
    surface.add_triangles(
        open3d.core.Tensor.from_numpy(world.nodes()),
        open3d.core.Tensor.from_numpy(MESH.surface().astype(np.uint32)),
    )
    distance = surface.compute_distance(open3d.core.Tensor.from_numpy(cloud)).numpy()
    assert len(cloud) > 4096
    assert distance.max() < 5e-5


def test_restoring_brings_back_the_rest_shape_while_the_clock_goes_on(
    world: QuasistaticWorld,
) -> None:
    world.reset(SCENE)
    before, joints = world.nodes(), world.joints
    pull(world, [0.02, -0.03, 0.03], seconds=0.5)
    assert world.time == pytest.approx(0.5)
    world.restore()
    np.testing.assert_array_equal(world.nodes(), before)
    np.testing.assert_array_equal(world.joints[1], joints[1])
    pull(world, [0.01, 0.0, 0.0], seconds=0.25)
    assert world.time == pytest.approx(0.75)


def test_a_motion_in_parts_ends_where_the_whole_does(world: QuasistaticWorld) -> None:
    world.reset(SCENE)
    start = world.joints[1]
    end = Placement().joints_at(1, world.tip + np.full(3, 0.03), near=start)
    path = start + np.linspace(0.0, 1.0, 7)[:, None] * (end - start)
    times = np.linspace(0.0, 0.6, 7)
    world.follow(path, times)
    whole = world.nodes()
    world.restore()
    for first in range(6):
        world.follow(path[first : first + 2], times[:2])
    np.testing.assert_allclose(world.nodes(), whole, atol=1e-5)
    np.testing.assert_array_equal(world.joints[1], end)


def test_standing_still_changes_nothing(world: QuasistaticWorld) -> None:
    world.reset(SCENE)
    pull(world, [0.02, 0.01, 0.02])
    before, time = world.nodes(), world.time
    world.follow(world.joints[1][None], np.zeros(1))
    np.testing.assert_allclose(world.nodes(), before, atol=2e-6)
    assert world.time == time


def test_the_way_does_not_matter_where_the_grasp_allows_one_shape(
    world: QuasistaticWorld,
) -> None:
    world.reset(SCENE)
    pull(world, [0.0, 0.04, 0.03])
    pull(world, [0.02, -0.03, 0.0])
    assert np.linalg.norm(world.tip - SCENE.manipulation_point) > 0.03
    assert world.deviation() < 5e-5


def test_a_strip_buckled_on_the_way_deviates(world: QuasistaticWorld) -> None:
    """Pushed together by 3 cm, it arches in one of several ways: as it was bent before."""
    strip = Tissue(size=(0.10, 0.02, 0.006), cells=(16, 3, 2))
    world.reset(Scene((0.0, 0.0), 0.0, (-0.045, 0.0, 0.006), (0.045, 0.0, 0.006), strip))
    for side in (1.0, -1.0):
        pull(world, [0.0, 0.0, 0.03 * side])
        pull(world, [-0.03, 0.0, -0.03 * side])
        assert world.settle().settled
        assert world.deviation() > 0.01
        world.restore()


def test_the_same_motions_give_the_same_bytes() -> None:
    """Also after another episode in the same world: a reset leaves nothing behind."""

    def shape(world: QuasistaticWorld) -> bytes:
        world.reset(SCENE)
        pull(world, [0.02, 0.03, 0.04])
        image = world.look()
        return world.nodes().tobytes() + image.depth.tobytes() + image.mask.tobytes()

    with closing(QuasistaticWorld()) as one, closing(QuasistaticWorld()) as other:
        first = shape(one)
        other.reset(replace(SCENE, yaw=-0.1))
        pull(other, [0.01, 0.01, 0.01])
        other.look()
        assert shape(other) == first
        assert shape(one) == first


def test_a_refused_reset_leaves_the_world_as_it_was(world: QuasistaticWorld) -> None:
    world.reset(SCENE)
    pull(world, [0.01, 0.0, 0.01])
    before = world.nodes()
    with pytest.raises(Unreachable):
        world.reset(replace(SCENE, manipulation_point=(0.6, 0.0, 0.04)))
    np.testing.assert_array_equal(world.nodes(), before)
    pull(world, [0.01, 0.0, 0.0])
    assert world.settle().settled
