"""The paper's way to gather data: one arm holds, the other deforms to random shapes."""

from collections import Counter
from collections.abc import Iterator
from typing import Protocol, runtime_checkable

import numpy as np

from dnet.errors import EmptyGrasp, NoValidShape, Unreachable
from dnet.sim.observe import See, observe
from dnet.sim.scenes import SoftBox, Workspace, draw_displacement, draw_scene
from dnet.sim.world import World
from dnet.types import Frame, Joints, Plan, Point, Scene

LEAST_VOLUME_RATIO = 0.05
"""A shape with a tetrahedron squeezed below this share of its volume is not one of tissue."""
PATIENCE = 100
"""Rejected draws in a row after which the settings must be at fault."""


@runtime_checkable
class Planner(Protocol):
    """Plans motions of the moving arm."""

    def plan(self, joints: tuple[Joints, Joints], displacement: Point, *, seed: int) -> Plan:
        """Return how to move the tip by `displacement` from where both arms stand."""
        ...


class Rollout:
    """One episode: a random scene, its rest shape, and random settled shapes.

    A shape that cannot be reached, does not come to rest, or turns a tetrahedron inside out is
    counted in `rejected` by reason and drawn again, from the rest shape.
    """

    def __init__(
        self,
        world: World,
        planner: Planner,
        see: See,
        *,
        workspace: Workspace,
        box: SoftBox,
        seed: tuple[int, int],
    ) -> None:
        """Draw the scene and set the world up for it.

        Args:
            world: Where it happens.
            planner: Of the moving arm.
            see: From images to clouds.
            workspace: The ranges of what is drawn.
            box: The object.
            seed: Of the recording, and the episode's number in it; episodes are independent.

        Raises:
            NoValidShape: If no scene of the workspace can be grasped.
        """
        self.rejected: Counter[str] = Counter()
        self._world, self._planner, self._see = world, planner, see
        self._workspace = workspace
        self._random = np.random.default_rng(seed)
        self._plans = 0
        self.scene = self._draw_scene(box)

    def frames(self, shapes: int) -> Iterator[Frame]:
        """Yield the rest frame and then `shapes` settled shapes.

        Raises:
            NoValidShape: If too many draws in a row are rejected.
        """
        self._world.settle()
        yield observe(self._world, self._see, "rest")
        for _ in range(shapes):
            yield self._shape()

    def _shape(self) -> Frame:
        for _ in range(PATIENCE):
            displacement = draw_displacement(self._workspace, self._random)
            reason = self._deform(np.array(self.scene.manipulation_point) + displacement)
            if reason is None:
                return observe(self._world, self._see, "shape")
            self.rejected[reason] += 1
            self._world.restore()
        raise NoValidShape("shape", PATIENCE, dict(self.rejected))

    def _deform(self, target: Point) -> str | None:
        """Bring the tip to a target and let the object settle; return what went wrong."""
        self._plans += 1
        motion = target - self._world.tip
        plan = self._planner.plan(self._world.joints, motion, seed=self._plans)
        if plan.status in ("partial", "failed"):
            return "unreachable"
        self._world.follow(plan.path, plan.times)
        settling = self._world.settle()
        if not settling.settled:
            return "unsettled"
        if settling.least_volume_ratio < LEAST_VOLUME_RATIO:
            return "inverted"
        return None

    def _draw_scene(self, box: SoftBox) -> Scene:
        for _ in range(PATIENCE):
            scene = draw_scene(self._workspace, box, self._random)
            try:
                self._world.reset(scene)
            except (Unreachable, EmptyGrasp):
                self.rejected["scene"] += 1
            else:
                return scene
        raise NoValidShape("scene", PATIENCE, dict(self.rejected))
