"""From a displacement of the tip to a timed, checked joint path, with what to do if it fails."""

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from dnet.errors import Unreachable
from dnet.planning.arm import METRES_PER_UNIT, Arm, Surroundings
from dnet.planning.line import Line, straight_line
from dnet.planning.rrt_connect import rrt_connect
from dnet.planning.timing import timed
from dnet.types import JointPath, Joints, Plan, PlanStatus, Point

DENSITY = 0.001
"""Between two checked positions of a planned path, in metres of tip motion."""


@dataclass(frozen=True)
class PlannerSettings:
    """When a plan is good enough."""

    attempts: int = 3
    """Random trees tried before a shorter motion is."""
    checks: int = 20_000
    """Collision checks that each may spend."""
    excursion: float = 0.015
    """How far a detour may drag the tip off the straight line, in metres: tissue comes along."""
    least_fraction: float = 0.2
    """Least share of a straight line worth moving."""
    least_motion: float = 0.002
    """Least motion worth moving, in metres."""


class ArmPlanner:
    """Plans motions of one arm among its surroundings.

    Tried in turn: the straight line of the tip; RRT-Connect to its end, shortened, unless the
    detour is too wide; the part of the straight line that is free; staying put. Each outcome
    has its name, and a part is never reported as the whole.
    """

    def __init__(
        self, arm: Arm, surroundings: Surroundings, settings: PlannerSettings | None = None
    ) -> None:
        """Plan for `arm` among `surroundings`."""
        self._arm = arm
        self._surroundings = surroundings
        self._settings = settings or PlannerSettings()
        self._checks = 0

    def _obstacle(self, joints: Joints) -> str | None:
        self._checks += 1
        return self._surroundings.obstacle(joints)

    def _first_obstacle(self, path: JointPath) -> tuple[int, str] | None:
        found = self._surroundings.first_obstacle(path)
        self._checks += len(path) if found is None else found[0] + 1
        return found

    def plan(
        self, joints: tuple[Joints, Joints], displacement: Point, *, seed: int, waypoints: int = 0
    ) -> Plan:
        """Return how to move the tip by `displacement`, its orientation the same at the end.

        Args:
            joints: Where the holding and the moving arm stand, (6,) each.
            displacement: Of the tip in the world, in metres, (3,).
            seed: Of the random search; the same seed gives the same plan.
            waypoints: Go no farther than so many checked positions, each DENSITY from the one
                before it; 0 for all of them. What is cut off so is `partial`.
        """
        clock = perf_counter()
        self._checks = 0
        holding, start = joints
        self._surroundings.stand(holding)
        status, path, reason = self._find(start, displacement, seed)
        if 0 < waypoints < len(path) - 1:
            cut = f"cut to the first {waypoints} of {len(path) - 1} waypoints"
            status, path, reason = "partial", path[: waypoints + 1], cut
        path, times = timed(self._arm, path)
        first, last = self._arm.forward_along(np.stack([start, path[-1]]))[:, :3, 3]
        achieved = last - first
        return Plan(
            status=status,
            path=path,
            times=times,
            requested=displacement.copy(),
            achieved=achieved,
            reason=reason,
            checks=self._checks,
            milliseconds=(perf_counter() - clock) * 1e3,
        )

    def _find(
        self, start: Joints, displacement: Point, seed: int
    ) -> tuple[PlanStatus, JointPath, str]:
        blocked = self._obstacle(start)
        if blocked:
            return "failed", start[None], f"the arm stands in the way: {blocked}"
        line = straight_line(self._arm, self._first_obstacle, start, displacement)
        if line.fraction == 1.0:
            return "straight", line.path, ""
        detour, reason = self._detour(start, displacement, seed)
        if detour is not None:
            return "rrt_connect", detour, line.stop
        reason = f"{line.stop}; {reason}"
        moved = line.fraction * float(np.linalg.norm(displacement))
        if self._worth(line, moved):
            return "partial", line.path, reason
        return "failed", start[None], reason

    def _worth(self, line: Line, moved: float) -> bool:
        return (
            line.fraction >= self._settings.least_fraction and moved >= self._settings.least_motion
        )

    def _detour(
        self, start: Joints, displacement: Point, seed: int
    ) -> tuple[JointPath | None, str]:
        """Return a path around what blocks the line, or None and why."""
        target = self._arm.forward(start)
        target[:3, 3] += displacement
        try:
            goal = self._arm.inverse(target, near=start)
        except Unreachable as error:
            return None, str(error)
        blocked = self._obstacle(goal)
        if blocked:
            return None, f"the goal touches {blocked}"
        reason = ""
        for attempt in range(self._settings.attempts):
            found = rrt_connect(
                self._arm,
                lambda joints: self._obstacle(joints) is None,
                start,
                goal,
                seed=seed * self._settings.attempts + attempt,
                checks=self._settings.checks,
            )
            if found is None:
                reason = f"no path within {self._settings.checks} collision checks"
                continue
            found = _densified(found)
            off = self._excursion(found)
            if off > self._settings.excursion:
                reason = f"the detour of {off * 1e3:.0f} mm is too wide"
            elif self._first_obstacle(found) is None:
                return found, ""
            else:
                reason = "the shortened path is not clear"
        return None, reason

    def _excursion(self, path: JointPath) -> float:
        """Return how far the tip strays from the straight segment, in metres."""
        tips = self._arm.forward_along(path)[:, :3, 3]
        chord = tips[-1] - tips[0]
        length = max(float(chord @ chord), 1e-18)
        along = np.clip((tips - tips[0]) @ chord / length, 0.0, 1.0)
        return float(np.linalg.norm(tips - tips[0] - along[:, None] * chord, axis=1).max())


def _densified(path: JointPath) -> JointPath:
    """Return the same polyline with positions at most DENSITY apart."""
    lengths = np.linalg.norm(np.diff(path, axis=0) * METRES_PER_UNIT, axis=1)
    counts = np.maximum(1, np.ceil(lengths / DENSITY).astype(int))
    pieces = [
        np.linspace(a, b, count, endpoint=False)
        for a, b, count in zip(path[:-1], path[1:], counts, strict=True)
    ]
    return np.concatenate([*pieces, path[-1:]])
