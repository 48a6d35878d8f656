"""The laboratory that `record` and `servo` work in: world, arms, planner and eyes, wired up."""

import json
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass, field
from functools import partial
from importlib.metadata import version
from typing import Any, Literal

from dnet.perception.cloud import POINTS, object_cloud
from dnet.perception.noise import DepthNoise
from dnet.planning.planner import ArmPlanner
from dnet.sim.arms import ArmModel
from dnet.sim.bullet_world import BulletSettings, BulletWorld
from dnet.sim.clearance import Clearance
from dnet.sim.observe import See
from dnet.sim.portrait import Portrait
from dnet.sim.quasistatic_world import QuasistaticWorld
from dnet.sim.scenes import Workspace
from dnet.sim.tetrahedra import to_vtk
from dnet.sim.tissue import tissue_mesh
from dnet.sim.urdf import psm_urdf
from dnet.sim.world import GraspingWorld
from dnet.types import Tissue

SHAPING = ("deformernet", "pybullet", "numpy", "scipy", "numba", "ompl")
"""The packages whose version decides what an episode holds."""


@dataclass(frozen=True)
class LaboratorySettings:
    """Everything that shapes what is recorded, besides the seed."""

    points: int = POINTS
    """Points of each cloud."""
    world: Literal["bullet", "quasistatic"] = "bullet"
    """Dynamics in PyBullet, or equilibria of the same energy by a solver of our own."""
    noise: DepthNoise | None = None
    """What the depth camera adds to what it sees; None for a perfect camera."""
    bullet: BulletSettings = field(default_factory=BulletSettings)
    workspace: Workspace = field(default_factory=Workspace)

    def describe(self) -> dict[str, Any]:
        """Return the settings and the versions behind them, as JSON would have it."""
        return asdict(self) | {"versions": {name: version(name) for name in SHAPING}}


@dataclass(frozen=True, eq=False)
class Laboratory:
    """Everything that moves, sees or plans."""

    settings: LaboratorySettings
    world: GraspingWorld
    planner: ArmPlanner
    arms: ArmModel
    see: See

    def portrait(self, tissue: Tissue, *, arms: bool) -> Portrait:
        """Return what draws an object as the laboratory's camera sees it."""
        bullet = self.settings.bullet
        return Portrait(tissue, camera=bullet.camera, placement=bullet.placement, arms=arms)

    def attachments(self, tissue: Tissue) -> dict[str, bytes]:
        """Return what an episode carries along: the arm, the object's mesh, the settings."""
        return {
            "psm.urdf": psm_urdf().encode(),
            "object.vtk": to_vtk(tissue_mesh(tissue)).encode(),
            "config.json": json.dumps(self.settings.describe(), indent=2, sort_keys=True).encode(),
        }


@contextmanager
def laboratory(settings: LaboratorySettings | None = None) -> Iterator[Laboratory]:
    """Set up the laboratory, and take it down at the end."""
    settings = settings or LaboratorySettings()
    bullet = settings.bullet
    with (
        closing(_world(settings)) as world,
        closing(Clearance(bullet.placement, bullet.camera)) as clearance,
    ):
        yield Laboratory(
            settings=settings,
            world=world,
            planner=ArmPlanner(bullet.placement.arms[1], clearance),
            arms=ArmModel(bullet.placement),
            see=partial(object_cloud, points=settings.points),
        )


def _world(settings: LaboratorySettings) -> BulletWorld | QuasistaticWorld:
    bullet = settings.bullet
    if settings.world == "quasistatic":
        return QuasistaticWorld(
            placement=bullet.placement, camera=bullet.camera, jaw_radius=bullet.jaw_radius
        )
    return BulletWorld(bullet)
