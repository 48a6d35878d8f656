"""What a servo run came to, read from its log alone: every figure follows from clouds in it."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from dnet.datasets.reader import EpisodeReader
from dnet.errors import BadReport, TooLarge
from dnet.files.sizes import LARGEST_JSON, parse_json, read_at_most
from dnet.geometry.chamfer import chamfer, legacy_chamfer
from dnet.geometry.node_distance import node_distance

RUN, REFUSED, LATENCY = "run.mcap", "refused.json", "latency.jsonl"
NEAR = 1.5
"""Times the floor within which a goal counts as met."""
MOST = 0.8
"""Share of the possible improvement that counts as most of it."""


@dataclass(frozen=True, slots=True)
class Score:
    """One run. Distances in metres; NaN where the log cannot tell."""

    goal: str
    outcome: str
    """How it ended, or `refused` if it could not begin."""
    motions: int
    first: float
    """Symmetric mean Chamfer distance to the goal at the start."""
    last: float
    """The same at the end."""
    floor: float
    """The same between two samplings of the goal shape."""
    legacy_first: float
    """The norm of the distances of all goal points, as the method's authors report it."""
    legacy_last: float
    legacy_floor: float
    nodes_first: float
    """Mean distance of the mesh's nodes from where they are in the goal, at the start."""
    nodes_last: float
    grasp_last: float
    """Distance of the grasp from where it is in the goal, at the end."""
    step_ms: float
    """Median wall time of a turn without the simulation; the one figure that is no pure
    function of the seed."""

    @property
    def near(self) -> bool:
        """Whether the shape cannot be told from the goal, or hardly."""
        return self.last <= NEAR * self.floor

    @property
    def improvement(self) -> float:
        """The share of the possible improvement: 1 at the floor, 0 for none."""
        possible = self.first - self.floor
        return (self.first - self.last) / possible if possible > 0 else float("nan")

    @property
    def most(self) -> bool:
        """Whether the run made most of the possible improvement."""
        return self.improvement >= MOST


def read_score(folder: Path) -> Score:
    """Return what the run in a directory came to.

    Raises:
        DnetError: If there is no finished run.
    """
    if not (folder / RUN).exists() and (folder / REFUSED).is_file():
        return _empty(folder.name, "refused")
    with EpisodeReader(folder / RUN) as run:
        goal, result = run.target(), run.result or {}
        outcome = str(result.get("outcome", "unfinished"))
        if goal is None or not len(run):
            return _empty(folder.name, outcome)
        start, end = run.cloud(0), run.cloud(len(run) - 1)
        floor = legacy_floor = float("nan")
        if goal.again is not None:
            floor = chamfer(goal.again, goal.cloud)
            legacy_floor = legacy_chamfer(goal.again, goal.cloud)
        grasp = float("nan")
        if goal.grasp is not None:
            grasp = float(np.linalg.norm(run.grasps[-1] - goal.grasp))
        return Score(
            goal=goal.source,
            outcome=outcome,
            motions=int(result.get("motions", 0)),
            first=chamfer(start, goal.cloud),
            last=chamfer(end, goal.cloud),
            floor=floor,
            legacy_first=legacy_chamfer(start, goal.cloud),
            legacy_last=legacy_chamfer(end, goal.cloud),
            legacy_floor=legacy_floor,
            nodes_first=node_distance(run.nodes(0), goal.nodes),
            nodes_last=node_distance(run.nodes(len(run) - 1), goal.nodes),
            grasp_last=grasp,
            step_ms=_turn_ms(folder / LATENCY),
        )


def _empty(goal: str, outcome: str) -> Score:
    return Score(goal, outcome, 0, *[float("nan")] * 10)


def _turn_ms(path: Path) -> float:
    if not path.is_file():
        return float("nan")
    stages = ("observe", "predict", "plan", "log")
    try:
        content = read_at_most(path, LARGEST_JSON, what="latencies").decode("utf-8")
        turns = [parse_json(line) for line in content.splitlines()]
        times = [sum(float(turn[name]) for name in stages) for turn in turns]
    except TooLarge:
        raise
    except (OSError, ValueError, KeyError, TypeError) as error:
        way_out = "remove the run, and repeat it"
        raise BadReport(path, f"is unreadable ({error!r})", way_out) from error
    return float(np.median(times or [np.nan]))
