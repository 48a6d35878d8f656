"""The laboratory that `record` and `servo` work in: world, arms, planner and eyes, wired up."""

import json
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from importlib.metadata import version
from typing import Any

from dnet.perception.cloud import POINTS, object_cloud
from dnet.planning.planner import ArmPlanner
from dnet.sim.arms import ArmModel
from dnet.sim.bullet_world import BulletSettings, BulletWorld
from dnet.sim.clearance import Clearance
from dnet.sim.observe import See
from dnet.sim.scenes import Workspace
from dnet.sim.tetrahedra import to_vtk
from dnet.sim.urdf import psm_urdf

SHAPING = ("deformernet", "pybullet", "numpy", "ompl", "fpsample")
"""The packages whose version decides what an episode holds."""


@dataclass(frozen=True, eq=False)
class Laboratory:
    """Everything that moves, sees or plans."""

    settings: BulletSettings
    workspace: Workspace
    world: BulletWorld
    planner: ArmPlanner
    arms: ArmModel
    see: See
    points: int

    def describe(self) -> dict[str, Any]:
        """Return everything that shapes what is recorded, as JSON would have it."""
        return {
            "world": "bullet",
            "points": self.points,
            "bullet": asdict(self.settings),
            "workspace": asdict(self.workspace),
            "versions": {name: version(name) for name in SHAPING},
        }

    def attachments(self) -> dict[str, bytes]:
        """Return what an episode carries along: the arm, the mesh, the settings."""
        return {
            "psm.urdf": psm_urdf().encode(),
            "object.vtk": to_vtk(self.world.mesh).encode(),
            "config.json": json.dumps(self.describe(), indent=2, sort_keys=True).encode(),
        }


@contextmanager
def laboratory(points: int = POINTS) -> Iterator[Laboratory]:
    """Set up the laboratory with its default settings, and take it down at the end."""
    settings, workspace = BulletSettings(), Workspace()
    with (
        closing(BulletWorld(settings)) as world,
        closing(Clearance(settings.placement, settings.camera)) as clearance,
    ):
        yield Laboratory(
            settings=settings,
            workspace=workspace,
            world=world,
            planner=ArmPlanner(settings.placement.arms[1], clearance),
            arms=ArmModel(settings.placement),
            see=partial(object_cloud, points=points),
            points=points,
        )
