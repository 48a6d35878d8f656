"""An honest fake of object, arm, planner and camera: a rigid cloud that goes where the tip goes."""

from dataclasses import dataclass, field, replace

import numpy as np

from dnet.sim.world import Settling
from dnet.types import Cloud, Frame, JointPath, Joints, Plan, Point, Step

SHAPE = np.random.default_rng(0).uniform(-0.05, 0.05, (256, 3)).astype(np.float32)
TARGET = np.array([0.03, -0.02, 0.01])


@dataclass
class Slab:
    """The first three joints of the moving arm are the tip's coordinates."""

    tip: Point = field(default_factory=lambda: np.zeros(3))
    time: float = 0.0
    blocked: bool = False
    slipped: float = 0.0
    seeds: list[int] = field(default_factory=list)

    def look(self) -> Frame:
        cloud = (SHAPE + self.tip).astype(np.float32)
        return Frame(self.time, "shape", cloud, self.tip.copy(), self.joints, cloud)

    @property
    def joints(self) -> tuple[Joints, Joints]:
        return np.zeros(6), np.concatenate([self.tip, np.zeros(3)])

    def follow(self, path: JointPath, times: np.ndarray) -> None:
        self.tip = path[-1, :3].copy()
        self.time += float(times[-1])

    def settle(self) -> Settling:
        self.time += 0.1
        return Settling(settled=True, steps=1, least_volume_ratio=1.0)

    def slip(self) -> float:
        return self.slipped

    def plan(
        self, joints: tuple[Joints, Joints], displacement: Point, *, seed: int, waypoints: int = 0
    ) -> Plan:
        self.seeds.append(seed)
        start = joints[1]
        if self.blocked:
            alone, now = start[None], np.zeros(1)
            return Plan("failed", alone, now, displacement, np.zeros(3), "a wall", 1, 0.0)
        end = start + np.concatenate([displacement, np.zeros(3)])
        path, times = np.array([start, end]), np.array([0.0, 0.5])
        return Plan("straight", path, times, displacement, displacement, "", 1, 0.0)


class Share:
    """A controller that sees the true displacement of the means and asks for a share of it."""

    def __init__(self, share: float) -> None:
        self.share = share

    def predict(self, current: Cloud, goal: Cloud) -> Point:
        return self.share * (goal.astype(float) - current).mean(axis=0)


@dataclass
class Notes:
    """A witness that remembers."""

    added: list[Step] = field(default_factory=list)
    timings: list[Step] = field(default_factory=list)

    def add(self, index: int, step: Step) -> None:
        assert index == len(self.added)
        self.added.append(step)

    def timed(self, index: int, step: Step) -> None:
        assert index == len(self.timings)
        self.timings.append(step)


def without_time(step: Step) -> Step:
    return replace(step, latency=None)
