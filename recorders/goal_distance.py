"""How far a frame is from the goal of a run, in every way that a viewer shows."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np
from jaxtyping import Float64, UInt8
from matplotlib import colormaps

from dnet.geometry.chamfer_to import ChamferTo
from dnet.geometry.node_distance import node_distance
from dnet.types import Frame, Gaps, Goal, Point

Colors = UInt8[np.ndarray, "_ 3"]

WORST = 0.02
"""Distance to the goal that has the colour of the worst, in metres."""
SHADES = 256
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
        self._distance = ChamferTo(goal.cloud)
        self.floor: Mapping[str, float] = (
            {} if goal.again is None else _figures(self._distance.gaps(goal.again))
        )
        """The least that each curve can be expected to come to, where that is known."""
        _table()  # Made before the first frame, whose latency counts.

    def __call__(self, frame: Frame, gaps: Gaps | None = None) -> Distances:
        """Return how far a frame with a cloud of one point or more is from the goal.

        Args:
            frame: What was seen.
            gaps: Of its cloud and the goal, if they are known already: they take the most time.
        """
        goal = self._goal
        gaps = self._distance.gaps(frame.cloud) if gaps is None else gaps
        figures = _figures(gaps)
        nodes = node_distance(frame.nodes, goal.nodes)
        if np.isfinite(nodes):
            figures["nodes"] = 1e3 * nodes
        motion = None if goal.grasp is None else goal.grasp - frame.grasp
        return Distances(colors_of(gaps.there), figures, motion)


def _figures(gaps: Gaps) -> dict[str, float]:
    return {"chamfer": 1e3 * gaps.chamfer, "legacy": float(np.linalg.norm(gaps.back))}


def colors_of(distances: Float64[np.ndarray, "_"]) -> Colors:
    """Return a colour for each distance, in metres."""
    shares = np.clip(distances / WORST, 0.0, 1.0)
    colors: Colors = _table()[(shares * (SHADES - 1)).astype(np.int64)]
    return colors


@cache
def _table() -> Colors:
    table: Callable[..., np.ndarray] = colormaps[COLORMAP]
    # The dark ends of the colour map would be lost on the dark ground.
    shares = 0.08 + 0.84 * np.linspace(0.0, 1.0, SHADES)
    colors: Colors = table(shares, bytes=True)[:, :3].copy()
    return colors
