"""Rollouts redraw what will not do, count it, and depend on nothing but their seed."""

from contextlib import closing

import numpy as np
import pytest

from dnet.errors import NoValidShape
from dnet.geometry.camera import Camera, DepthImage
from dnet.planning.planner import ArmPlanner
from dnet.sim.arms import Placement
from dnet.sim.bullet_world import BulletWorld
from dnet.sim.clearance import Clearance
from dnet.sim.rollout import Rollout
from dnet.sim.scenes import SoftBox, Workspace, draw_displacement, draw_scene
from dnet.sim.world import Settling
from dnet.types import Cloud, Frame, JointPath, Joints, Nodes, Plan, Point, Scene


def blind(image: DepthImage, object_id: int) -> Cloud:
    """Clouds are not what is tested here."""
    return np.zeros((1, 3), np.float32)


def episode(world: BulletWorld, planner: ArmPlanner, index: int) -> list[Frame]:
    rollout = Rollout(world, planner, blind, workspace=Workspace(), box=SoftBox(), seed=(7, index))
    return list(rollout.frames(2))


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

    def __init__(self, ratios: list[float], *, settled: bool = True) -> None:
        self.ratios, self.settled, self.calls = ratios, settled, 0
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
        self.tip_now = self.tip_now + path[-1, :3]

    def settle(self) -> Settling:
        self.calls += 1
        return Settling(self.settled or self.calls == 1, 20, self.ratios[self.calls % 2])

    def look(self) -> DepthImage:
        camera = Camera(width=1, height=1)
        return DepthImage(np.ones((1, 1), np.float32), np.zeros((1, 1), np.int32), camera)

    def plan(self, joints: tuple[Joints, Joints], displacement: Point, *, seed: int) -> Plan:
        path = np.concatenate([displacement, np.zeros(3)])[None]
        return Plan("straight", path, np.zeros(1), displacement, displacement, "", 1, 0.0)


def test_inverted_shapes_are_counted_and_drawn_again_from_rest() -> None:
    world = Moody([-0.1, 0.9])
    rollout = Rollout(world, world, blind, workspace=Workspace(), box=SoftBox(), seed=(0, 0))
    frames = list(rollout.frames(3))
    assert len(frames) == 4
    assert rollout.rejected == {"inverted": 3}
    assert world.restored == 3


def test_a_world_that_never_settles_is_given_up_with_the_count() -> None:
    world = Moody([0.9, 0.9], settled=False)
    rollout = Rollout(world, world, blind, workspace=Workspace(), box=SoftBox(), seed=(0, 0))
    with pytest.raises(NoValidShape, match=r"no valid shape in 100 random draws \(100 unsettled\)"):
        list(rollout.frames(1))


def test_scenes_and_displacements_stay_within_the_workspace() -> None:
    workspace, box = Workspace(), SoftBox()
    random = np.random.default_rng(0)
    for _ in range(200):
        scene = draw_scene(workspace, box, random)
        assert abs(scene.yaw) <= workspace.yaw
        assert np.all(np.abs(scene.position) <= workspace.position)
        for point in (scene.hold, scene.manipulation_point):
            back = np.array(point[:2]) - scene.position
            cosine, sine = np.cos(-scene.yaw), np.sin(-scene.yaw)
            local = np.array([[cosine, -sine], [sine, cosine]]) @ back
            assert np.all(np.abs(local) <= 0.05)
            assert point[2] == box.size[2]
        displacement = draw_displacement(workspace, random)
        assert np.all(displacement >= workspace.displacement_low)
        assert np.all(displacement <= workspace.displacement_high)
