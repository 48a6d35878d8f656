"""The paper's way to gather data: one arm holds, the other deforms to random shapes."""

from collections import Counter
from collections.abc import Callable, Iterator
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from dnet.errors import EmptyGrasp, NoValidShape, Unreachable
from dnet.sim.foresight import LEAST_VOLUME_RATIO
from dnet.sim.scenes import Workspace, draw_displacement, draw_scene
from dnet.sim.world import World
from dnet.types import Frame, FrameKind, JointPath, Joints, Plan, Point, Scene, Tissue

Times = Float64[np.ndarray, "_"]
DrawTissue = Callable[[np.random.Generator], Tissue]

LARGEST_DEVIATION = 0.005
"""A shape with a node farther than this from where the same grasp takes it straight from rest is
one of several that the grasp allows, in metres."""
PATIENCE = 100
"""Rejected draws in a row after which the settings must be at fault."""

Observe = Callable[[FrameKind], Frame]
"""Looks at the world now."""


@runtime_checkable
class Planner(Protocol):
    """Plans motions of the moving arm."""

    def plan(self, joints: tuple[Joints, Joints], displacement: Point, *, seed: int) -> Plan:
        """Return how to move the tip by `displacement` from where both arms stand."""
        ...


class Rollout:
    """One episode: a random scene, its rest shape, and random settled shapes.

    A shape is drawn again, from the rest shape, and counted in `rejected` if it is `unreachable`,
    `unsettled` (does not come to rest), `inverted` (a tetrahedron is turned inside out, as it is
    foreseen or as it comes to be), or `bistable` (the grasp allows another shape, which it would
    have reached straight from rest).
    A scene that cannot be grasped is counted as `scene`.
    """

    def __init__(
        self,
        world: World,
        planner: Planner,
        observe: Observe,
        *,
        workspace: Workspace,
        draw_tissue: DrawTissue,
        seed: tuple[int, int],
        rate: float = 0.0,
    ) -> None:
        """Draw the scene and set the world up for it.

        Args:
            world: Where it happens.
            planner: Of the moving arm.
            observe: Looks at the world.
            workspace: The ranges of what is drawn.
            draw_tissue: Draws the object.
            seed: Of the recording, and the episode's number in it; episodes are independent.
            rate: Frames on the way to a shape, a second of simulation; 0 for none.

        Raises:
            NoValidShape: If no scene of the workspace can be grasped.
            NoReachableSurface: If no part of the object can be grasped.
        """
        self.rejected: Counter[str] = Counter()
        self.deviations: list[float] = []
        """How far each accepted shape is from that which the grasp reaches straight from rest:
        the worst node, in metres."""
        self._world, self._planner, self._observe = world, planner, observe
        self._workspace, self._rate = workspace, rate
        self._random = np.random.default_rng(seed)
        self._plans = 0
        self.scene = self._draw_scene(draw_tissue)

    def frames(self, shapes: int) -> Iterator[Frame]:
        """Yield the rest frame, then `shapes` settled shapes, each after the frames on its way.

        Raises:
            NoValidShape: If too many draws in a row are rejected.
        """
        self._world.settle()
        yield self._observe("rest")
        for _ in range(shapes):
            yield from self._shape()

    def _shape(self) -> list[Frame]:
        for _ in range(PATIENCE):
            displacement = draw_displacement(self._workspace, self._random)
            seen, fault = self._try(displacement)
            if fault is None:
                return seen
            self.rejected[fault] += 1
        raise NoValidShape("shape", PATIENCE, dict(self.rejected))

    def _try(self, displacement: Point) -> tuple[list[Frame], str | None]:
        """Return what is seen of a displacement from rest, and what is wrong with it, if anything.

        What can be known beforehand is: a body that is turned inside out takes long to settle.
        """
        if self._world.foresee(displacement) < LEAST_VOLUME_RATIO:
            return [], "inverted"
        plan = self._plan(np.array(self.scene.manipulation_point) + displacement)
        if plan.status in ("partial", "failed"):
            return [], "unreachable"
        seen = self._follow(plan)
        fault = self._fault()
        if fault is not None:
            self._world.restore()
            return [], fault
        return [*seen, self._observe("shape")], None

    def _plan(self, target: Point) -> Plan:
        self._plans += 1
        motion = target - self._world.tip
        return self._planner.plan(self._world.joints, motion, seed=self._plans)

    def _follow(self, plan: Plan) -> list[Frame]:
        """Follow a plan to its end; return what is seen on the way."""
        duration = float(plan.times[-1])
        count = int(np.ceil(duration * self._rate))
        way, last = [], 0.0
        for stop in (number / self._rate for number in range(1, count)):
            self._world.follow(*between(plan, last, stop))
            way.append(self._observe("way"))
            last = stop
        self._world.follow(*between(plan, last, duration))
        return way

    def _fault(self) -> str | None:
        """Let the object settle; return what is wrong with its shape, None if nothing."""
        settling = self._world.settle()
        if not settling.settled:
            return "unsettled"
        if settling.least_volume_ratio < LEAST_VOLUME_RATIO:
            return "inverted"
        deviation = self._world.deviation()
        if deviation > LARGEST_DEVIATION:
            return "bistable"
        self.deviations.append(deviation)
        return None

    def _draw_scene(self, draw_tissue: DrawTissue) -> Scene:
        for _ in range(PATIENCE):
            scene = draw_scene(self._workspace, draw_tissue(self._random), self._random)
            try:
                self._world.reset(scene)
            except (Unreachable, EmptyGrasp):
                self.rejected["scene"] += 1
                continue
            if self._plan(self._world.tip).status != "failed":
                return scene
            self.rejected["scene"] += 1
        raise NoValidShape("scene", PATIENCE, dict(self.rejected))


def between(plan: Plan, start: float, end: float) -> tuple[JointPath, Times]:
    """Return the part of a plan between two instants, its times from 0."""
    inside = (plan.times > start) & (plan.times < end)
    times = np.array([start, *plan.times[inside], end])
    columns = [np.interp(times, plan.times, column) for column in plan.path.T]
    return np.column_stack(columns), times - start
