"""A made-up rollout: a box bent by a formula, held and pulled by the real arms' kinematics."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from dnet.geometry.camera import Camera
from dnet.geometry.chamfer import chamfer
from dnet.recorders.episode import EpisodeWriter
from dnet.sim.arms import ArmModel, Placement
from dnet.sim.urdf import psm_urdf
from dnet.types import EpisodeMeta, Frame, FrameKind, Look, Plan, Point, Scene, Step

ARMS = ArmModel(Placement())
HOLD = np.array([-0.045, 0.0, 0.04])
GRASP = np.array([0.035, 0.0, 0.04])
HOLDING = ARMS.placement.joints_at(0, HOLD)
SCENE = Scene(
    position=(0.001, -0.002),
    yaw=0.1,
    hold=(-0.045, 0.0, 0.04),
    manipulation_point=(0.035, 0.0, 0.04),
)
SETTINGS = {"box": {"size": [0.1, 0.1, 0.04]}, "name": "weiches Gewebe, 软", "none": None}


def meta(name: str = "episode-0") -> EpisodeMeta:
    return EpisodeMeta(episode_id=name, seed=3, index=7, scene=SCENE, settings=SETTINGS)


def frame(time: float, motion: Point, kind: FrameKind = "shape", *, points: int = 64) -> Frame:
    rng = np.random.default_rng(0)
    rest = rng.uniform([-0.05, -0.05, 0.0], [0.05, 0.05, 0.04], (points, 3))
    share = np.clip((rest[:, :1] + 0.05) / 0.1, 0.0, 1.0) ** 2
    bent = (rest + share * motion).astype(np.float32)
    grasp = GRASP + motion
    return Frame(
        time=time,
        kind=kind,
        cloud=bent,
        grasp=grasp,
        joints=(HOLDING, ARMS.placement.joints_at(1, grasp)),
        nodes=bent[::2].copy(),
    )


def frames(count: int = 5, *, seed: int = 0, points: int = 64) -> list[Frame]:
    """A rest frame, then shapes with one frame on the way to each."""
    rng = np.random.default_rng(seed)
    found = [frame(0.0, np.zeros(3), "rest", points=points)]
    last = np.zeros(3)
    for number in range(1, count):
        motion = rng.uniform([-0.02, -0.03, 0.0], [0.03, 0.03, 0.04])
        found.append(frame(number - 0.5, (last + motion) / 2, "way", points=points))
        found.append(frame(float(number), motion, points=points))
        last = motion
    return found


def with_image(one: Frame, camera: Camera, *, seed: int = 0) -> Frame:
    """The frame with an image in which nothing but the size is likely."""
    rng = np.random.default_rng(seed)
    shape = (camera.height, camera.width)
    depth = rng.uniform(0.3, 0.5, shape).astype(np.float32)
    return replace(one, image=Look(depth, rng.integers(0, 5, shape).astype(np.uint8)))


def step(seen: Frame, goal: Frame, *, planned: bool = True) -> Step:
    motion = goal.grasp - seen.grasp
    plan = None
    if planned:
        path = np.stack([seen.joints[1], goal.joints[1]])
        plan = Plan(
            status="straight",
            path=path,
            times=np.array([0.0, 0.5]),
            requested=motion,
            achieved=motion,
            reason="",
            checks=2,
            milliseconds=1.5,
        )
    return Step(frame=seen, chamfer=chamfer(seen.cloud, goal.cloud), motion=motion, plan=plan)


def write(
    path: Path, seen: Sequence[Frame], *, name: str | None = None, camera: Camera | None = None
) -> Path:
    """Write a finished recording with the arms' URDF attached."""
    attachments = {"psm.urdf": psm_urdf().encode(), "config.json": b"{}"}
    with EpisodeWriter(
        path, meta(name or path.stem), arms=ARMS, attachments=attachments, camera=camera
    ) as writer:
        for one in seen:
            writer.add(one)
        writer.finish({"frames": len(seen), "rejected": {"folded": 2}})
    return path


def write_servo(path: Path) -> Path:
    """Write a finished servo run of three steps towards the second shape."""
    seen = frames(3)
    goal = seen[-1]
    attachments = {"psm.urdf": psm_urdf().encode()}
    with EpisodeWriter(path, meta(path.stem), arms=ARMS, attachments=attachments) as writer:
        writer.set_goal(goal.cloud)
        for index, one in enumerate((seen[0], seen[2], seen[4])):
            writer.add_step(step(one, goal, planned=one is not goal), index)
        writer.finish({"outcome": "converged"})
    return path
