"""How far a frame is from the goal of a run, in every way that a viewer shows."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float64, UInt8
from matplotlib import colormaps
from scipy.spatial import cKDTree

from dnet.geometry.node_distance import node_distance
from dnet.types import Cloud, Frame, Goal, Point

Colors = UInt8[np.ndarray, "_ 3"]

WORST = 0.02
"""Distance to the goal that has the colour of the worst, in metres."""
COLORMAP = "turbo"
"""From blue, at the goal, over green and yellow to red."""


@dataclass(frozen=True, slots=True)
class Distances:
    """Of one frame from the goal."""

    colors: Colors
    """Of each point of the cloud, by its distance to the nearest of the goal."""
    figures: Mapping[str, float]
    """By the name of the curve, in its unit; those that are known."""
    motion: Point | None
    """The true motion of the grasp that is left, if it is known."""


class GoalDistance:
    """Measures frames against the goal of a run; the goal's search tree is built once."""

    def __init__(self, goal: Goal) -> None:
        self._goal = goal
        self._tree = cKDTree(goal.cloud)

    def __call__(self, frame: Frame) -> Distances:
        """Return how far a frame with a cloud of one point or more is from the goal."""
        goal = self._goal
        there, figures = self._figures(frame.cloud)
        nodes = node_distance(frame.nodes, goal.nodes)
        if np.isfinite(nodes):
            figures["nodes"] = 1e3 * nodes
        motion = None if goal.grasp is None else goal.grasp - frame.grasp
        return Distances(colors_of(there), figures, motion)

    def _figures(self, cloud: Cloud) -> tuple[Float64[np.ndarray, "_"], dict[str, float]]:
        """Return the distance of each point to the goal, and what follows from both clouds."""
        there, _ = self._tree.query(cloud)
        back, _ = cKDTree(cloud, balanced_tree=False, compact_nodes=False).query(self._goal.cloud)
        figures = {
            "chamfer": 1e3 * (float(np.mean(there)) + float(np.mean(back))) / 2,
            "legacy": float(np.linalg.norm(back)),
        }
        return np.asarray(there, dtype=np.float64), figures

    @cached_property
    def floor(self) -> Mapping[str, float]:
        """The least that each curve can be expected to come to, where that is known."""
        again = self._goal.again
        return {} if again is None else self._figures(again)[1]


def colors_of(distances: Float64[np.ndarray, "_"]) -> Colors:
    """Return a colour for each distance, in metres."""
    shares = np.clip(distances / WORST, 0.0, 1.0)
    table: Callable[..., np.ndarray] = colormaps[COLORMAP]
    # The dark ends of the colour map would be lost on the dark ground.
    colors: Colors = table(0.08 + 0.84 * shares, bytes=True)[:, :3].copy()
    return colors
