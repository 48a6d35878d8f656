"""Random pulls of the object in PyBullet: what a recording does, without looking at it."""

import time
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass

import numpy as np

from dnet.errors import EmptyGrasp, NoValidShape, Unreachable
from dnet.sim.bullet_world import BulletWorld
from dnet.sim.foresight import LEAST_VOLUME_RATIO
from dnet.sim.grasp import grasp
from dnet.sim.rollout import PATIENCE
from dnet.sim.scenes import Workspace, draw_displacement, draw_scene
from dnet.sim.soft_body import NodeIndices
from dnet.sim.tetrahedra import Vertices
from dnet.types import Point, Scene, Tissue

SPEED = 0.2
"""Of the gripper, in metres a second."""


@dataclass(frozen=True, eq=False)
class Pull:
    """A shape that has come to rest, and how it came about."""

    rest: Vertices
    """The nodes before the pull, in metres, (n, 3)."""
    nodes: Vertices
    """The nodes after it, in metres, (n, 3)."""
    pinned: NodeIndices
    """The nodes that the two arms grip."""
    displacement: Point
    """Of the gripper, in metres, (3,)."""
    steps: int
    """Simulation steps that it took, to move and to settle."""
    seconds: float
    """Processor time of these steps."""


def pulls(tissue: Tissue, count: int, *, seed: int, rejected: Counter[str]) -> Iterator[Pull]:
    """Yield `count` pulls in random scenes, from the ranges that recordings draw from.

    As in a recording, what the arms cannot reach, does not settle or turns a tetrahedron inside
    out is drawn again.

    Args:
        tissue: The object and its mesh.
        count: How many pulls.
        seed: Of the scenes and the displacements.
        rejected: Counts here by reason what is drawn again.

    Raises:
        NoValidShape: If too many draws in a row are rejected.
    """
    random = np.random.default_rng(seed)
    workspace = Workspace()
    with closing(BulletWorld()) as world:
        for _ in range(count):
            for _ in range(PATIENCE):
                scene = draw_scene(workspace, tissue, random)
                pull = _pull(world, scene, draw_displacement(workspace, random))
                if isinstance(pull, Pull):
                    yield pull
                    break
                rejected[pull] += 1
            else:
                raise NoValidShape("pull", PATIENCE, dict(rejected))


def _pull(world: BulletWorld, scene: Scene, displacement: Point) -> Pull | str:
    """Return what a pull comes to, or why not."""
    settings = world.settings
    try:
        start = grasp(scene, settings.placement, jaw_radius=settings.jaw_radius)
        world.reset(scene)
        before = world.joints[1]
        after = settings.placement.joints_at(1, world.tip + displacement, near=before)
    except (Unreachable, EmptyGrasp):
        return "unreachable"
    duration = float(np.linalg.norm(displacement)) / SPEED
    begin = time.process_time()
    world.follow(np.array([before, after]), np.array([0.0, duration]))
    settling = world.settle()
    seconds = time.process_time() - begin
    if not settling.settled:
        return "unsettled"
    if settling.least_volume_ratio < LEAST_VOLUME_RATIO:
        return "inverted"
    moving = int(np.ceil(duration / settings.time_step(scene.tissue)))
    return Pull(
        rest=start.rest,
        nodes=world.nodes().astype(np.float64),
        pinned=start.pinned,
        displacement=displacement,
        steps=moving + settling.steps,
        seconds=seconds,
    )
