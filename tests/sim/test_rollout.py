"""Rollouts redraw what will not do, count it, and depend on nothing but their seed."""

from contextlib import closing
from functools import partial

import numpy as np
import pytest

from dnet.errors import NoReachableSurface, NoValidShape
from dnet.geometry.camera import Camera, DepthImage
from dnet.geometry.pose import rotation_z
from dnet.planning.planner import ArmPlanner
from dnet.sim.arms import Placement
from dnet.sim.bullet_world import BulletWorld
from dnet.sim.clearance import Clearance
from dnet.sim.observe import observe
from dnet.sim.rollout import Planner, Rollout, between
from dnet.sim.scenes import Workspace, draw_displacement, draw_scene
from dnet.sim.world import Settling, World
from dnet.types import Cloud, Frame, JointPath, Joints, Nodes, Plan, Point, Scene, Tissue


def blind(image: DepthImage, object_id: int) -> Cloud:
    """Clouds are not what is tested here."""
    return np.zeros((1, 3), np.float32)


def the_box(random: np.random.Generator) -> Tissue:
    return Tissue()


def rollout_in(
    world: World, planner: Planner, *, seed: tuple[int, int] = (0, 0), rate: float = 0.0
) -> Rollout:
    return Rollout(
        world,
        planner,
        partial(observe, world, blind),
        workspace=Workspace(),
        draw_tissue=the_box,
        seed=seed,
        rate=rate,
    )


def episode(world: BulletWorld, planner: ArmPlanner, index: int) -> list[Frame]:
    return list(rollout_in(world, planner, seed=(7, index)).frames(2))


def test_an_episode_does_not_depend_on_those_before_it() -> None:
    place = Placement()
    with closing(BulletWorld()) as world, closing(Clearance(place, Camera())) as clearance:
        planner = ArmPlanner(place.arms[1], clearance)
        episode(world, planner, 0)
        second = episode(world, planner, 1)
        alone = episode(world, planner, 1)
    for one, other in zip(second, alone, strict=True):
        assert one.nodes.tobytes() == other.nodes.tobytes()
        assert one.time == other.time
    assert [frame.kind for frame in second] == ["rest", "shape", "shape"]
    assert second[0].time < second[1].time < second[2].time
    motions = [frame.grasp - second[0].grasp for frame in second[1:]]
    assert all(0.005 < np.linalg.norm(motion) < 0.1 for motion in motions)


class Moody:
    """A world in which every other shape is turned inside out, and a planner that obeys."""

    def __init__(
        self,
        ratios: list[float],
        *,
        settled: bool = True,
        deviation: float = 0.0,
        foreseen: float = -1.0,
    ) -> None:
        self.ratios, self.settled, self.calls = ratios, settled, 0
        self.deviated, self.foreseen = deviation, foreseen
        self.paths: list[tuple[JointPath, np.ndarray]] = []
        self.tip_now = np.zeros(3)
        self.restored = 0
        self.time = 0.0
        self.object_id = 0
        self.joints: tuple[Joints, Joints] = (np.zeros(6), np.zeros(6))

    @property
    def tip(self) -> Point:
        return self.tip_now

    def reset(self, scene: Scene) -> None:
        self.start = np.array(scene.manipulation_point)
        self.tip_now = self.start

    def restore(self) -> None:
        self.restored += 1
        self.tip_now = self.start

    def nodes(self) -> Nodes:
        return np.zeros((1, 3), np.float32)

    def follow(self, path: JointPath, times: np.ndarray) -> None:
        self.paths.append((path, times))
        self.tip_now = self.tip_now + path[-1, :3] - path[0, :3]
        self.time += float(times[-1])

    def settle(self) -> Settling:
        self.calls += 1
        return Settling(self.settled or self.calls == 1, 20, self.ratios[self.calls % 2])

    def foresee(self, displacement: Point) -> float:
        return -0.1 if displacement[0] < self.foreseen else 0.9

    def deviation(self) -> float:
        return self.deviated

    def look(self) -> DepthImage:
        camera = Camera(width=1, height=1)
        return DepthImage(np.ones((1, 1), np.float32), np.zeros((1, 1), np.int32), camera)

    def plan(self, joints: tuple[Joints, Joints], displacement: Point, *, seed: int) -> Plan:
        path = np.zeros((2, 6))
        path[1, :3] = displacement
        return Plan("straight", path, np.array([0.0, 1.0]), displacement, displacement, "", 1, 0.0)


def test_inverted_shapes_are_counted_and_drawn_again_from_rest() -> None:
    world = Moody([-0.1, 0.9])
    rollout = rollout_in(world, world)
    frames = list(rollout.frames(3))
    assert len(frames) == 4
    assert rollout.rejected == {"inverted": 3}
    assert world.restored == 3


def test_shapes_that_are_foreseen_to_invert_are_counted_and_never_tried() -> None:
    world = Moody([0.9, 0.9], foreseen=0.02)
    rollout = rollout_in(world, world)
    frames = list(rollout.frames(20))
    assert rollout.rejected["inverted"] > 3
    assert len(world.paths) == 20
    assert world.restored == 0
    start = frames[0].grasp[0]
    assert all(frame.grasp[0] - start >= 0.02 for frame in frames[1:])


def test_a_world_that_never_settles_is_given_up_with_the_count() -> None:
    world = Moody([0.9, 0.9], settled=False)
    rollout = rollout_in(world, world)
    with pytest.raises(NoValidShape, match=r"no valid shape in 100 random draws \(100 unsettled\)"):
        list(rollout.frames(1))


def test_a_grasp_that_allows_several_shapes_is_given_up_with_the_count() -> None:
    world = Moody([0.9, 0.9], deviation=0.02)
    rollout = rollout_in(world, world)
    with pytest.raises(NoValidShape, match=r"no valid shape in 100 random draws \(100 bistable\)"):
        list(rollout.frames(1))
    assert rollout.deviations == []


def test_frames_on_the_way_come_at_their_rate_before_their_shape() -> None:
    world = Moody([0.9, 0.9])
    frames = list(rollout_in(world, world, rate=4.0).frames(2))
    assert [frame.kind for frame in frames] == ["rest", *["way", "way", "way", "shape"] * 2]
    np.testing.assert_allclose([frame.time for frame in frames], np.arange(9) / 4)


def test_the_frames_on_the_way_to_a_rejected_shape_are_not_kept() -> None:
    world = Moody([-0.1, 0.9])
    rollout = rollout_in(world, world, rate=4.0)
    frames = list(rollout.frames(2))
    assert rollout.rejected == {"inverted": 2}
    assert [frame.kind for frame in frames] == ["rest", *["way", "way", "way", "shape"] * 2]


def test_parts_of_a_plan_make_the_whole() -> None:
    random = np.random.default_rng(0)
    path, times = random.normal(size=(9, 6)), np.cumsum(random.uniform(0.1, 0.3, size=9))
    plan = Plan("straight", path, times - times[0], np.zeros(3), np.zeros(3), "", 1, 0.0)
    end = float(plan.times[-1])
    (one, early), (other, late) = between(plan, 0.0, end / 3), between(plan, end / 3, end)
    assert early[0] == late[0] == 0
    np.testing.assert_allclose(one[-1], other[0])
    joined_times = np.concatenate([early, late[1:] + end / 3])
    joined = np.concatenate([one, other[1:]])
    for column in range(6):
        np.testing.assert_allclose(
            np.interp(plan.times, joined_times, joined[:, column]), path[:, column]
        )


def test_scenes_and_displacements_stay_within_the_workspace() -> None:
    workspace, tissue = Workspace(), Tissue()
    random = np.random.default_rng(0)
    for _ in range(200):
        scene = draw_scene(workspace, tissue, random)
        assert scene.tissue == tissue
        assert abs(scene.yaw) <= workspace.yaw
        assert np.all(np.abs(scene.position) <= workspace.position)
        x, y, z = local(scene, scene.manipulation_point)
        assert -1e-9 <= x <= 0.05 + 1e-9
        assert abs(y) <= 0.05 + 1e-9
        # On top, or on the end that faces the moving arm.
        assert z == pytest.approx(0.04) or x == pytest.approx(0.05)
        np.testing.assert_allclose(local(scene, scene.hold), [-0.05, 0.0, 0.04], atol=1e-12)
        displacement = draw_displacement(workspace, random)
        assert np.all(displacement >= workspace.displacement_low)
        assert np.all(displacement <= workspace.displacement_high)


def test_manipulation_points_are_spread_evenly_over_the_reachable_surface() -> None:
    """The top's far half is 50 cm^2, the end face 40 cm^2."""
    random = np.random.default_rng(1)
    scenes = [draw_scene(Workspace(), Tissue(), random) for _ in range(2000)]
    top = np.mean([scene.manipulation_point[2] > 0.04 - 1e-9 for scene in scenes])
    assert top == pytest.approx(5 / 9, abs=0.04)


def test_an_object_too_short_to_grasp_is_refused() -> None:
    short = Tissue(size=(0.03, 0.03, 0.03), cells=(3, 3, 3))
    with pytest.raises(NoReachableSurface, match="30 x 30 x 30 mm"):
        draw_scene(Workspace(), short, np.random.default_rng(0))


def local(scene: Scene, point: tuple[float, float, float]) -> np.ndarray:
    """A point in the object's own frame."""
    offset = np.array(point) - np.array([*scene.position, 0.0])
    return rotation_z(-scene.yaw) @ offset
