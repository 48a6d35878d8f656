"""Whether episodes can be made: a soft body is moved, a path planned, an episode written."""

import tempfile
from pathlib import Path

import numpy as np

from dnet.sim.arms import ArmModel, Placement
from dnet.types import EpisodeMeta, Frame, Scene

POINTS = 64


def step() -> str:
    """Let PyBullet move a soft box by some steps under gravity."""
    from dnet.sim.bullet import pybullet, start_server  # noqa: PLC0415
    from dnet.sim.soft_body import SoftBody  # noqa: PLC0415
    from dnet.sim.tetrahedra import box_mesh  # noqa: PLC0415

    mesh = box_mesh((0.1, 0.1, 0.04), (2, 2, 1))
    client = start_server()
    try:
        pybullet.resetSimulation(pybullet.RESET_USE_DEFORMABLE_WORLD, physicsClientId=client)
        pybullet.setGravity(0, 0, -9.81, physicsClientId=client)
        body = SoftBody(client, mesh, young=1000.0, poisson=0.3, density=1000.0)
        for _ in range(5):
            pybullet.stepSimulation(physicsClientId=client)
        fallen = float((mesh.nodes - body.nodes())[:, 2].mean())
    finally:
        pybullet.disconnect(physicsClientId=client)
    if not 0.0 < fallen < 1.0:
        raise RuntimeError(f"a soft body has fallen by {fallen} m in 5 steps")
    return f"PyBullet moved {len(mesh.nodes)} nodes"


def plan() -> str:
    """Let OMPL plan a motion of the arm through free space."""
    from dnet.planning.rrt_connect import rrt_connect  # noqa: PLC0415

    placement = Placement()
    start, goal = (placement.joints_at(1, np.array([0.03, side, 0.06])) for side in (-0.02, 0.02))
    path = rrt_connect(placement.arms[1], lambda _: True, start, goal, seed=0, checks=2000)
    if path is None:
        raise RuntimeError("OMPL found no path through free space")
    return f"OMPL planned {np.linalg.norm(np.diff(path, axis=0), axis=1).sum():.2f} of joint path"


def log() -> str:
    """Write an episode and read its frames again."""
    from dnet.datasets.reader import EpisodeReader  # noqa: PLC0415
    from dnet.recorders.episode import EpisodeWriter  # noqa: PLC0415

    hold, grasp = np.array([-0.045, 0.0, 0.04]), np.array([0.035, 0.0, 0.04])
    arms = ArmModel(Placement())
    joints = (arms.placement.joints_at(0, hold), arms.placement.joints_at(1, grasp))
    cloud = np.random.default_rng(0).uniform(-0.05, 0.05, (POINTS, 3)).astype(np.float32)
    frame = Frame(time=0.0, kind="rest", cloud=cloud, grasp=grasp, joints=joints, nodes=cloud)
    scene = Scene(
        position=(0.0, 0.0),
        yaw=0.0,
        hold=(-0.045, 0.0, 0.04),
        manipulation_point=(0.035, 0.0, 0.04),
    )
    meta = EpisodeMeta(episode_id="episode-0", seed=0, index=0, scene=scene, settings={})
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "episode-0.mcap"
        with EpisodeWriter(path, meta, arms=arms, attachments={}) as writer:
            writer.add(frame)
            writer.finish({})
        with EpisodeReader(path) as episode:
            seen = episode.frame(0)
        size = path.stat().st_size
    if not np.array_equal(seen.cloud, cloud):
        raise RuntimeError("an episode reads otherwise than it was written")
    return f"an episode of {size / 1e3:.0f} kB written and read"
