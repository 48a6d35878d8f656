"""What is asked of one servo run: all that decides about it, so that it can go to a process."""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from dnet.laboratory import LaboratorySettings
from dnet.servo.verdict import ServoSettings

ControllerName = Literal["deformernet", "hu", "hu-online", "oracle", "none", "rrt"]
"""`deformernet`: a trained network; `hu`: that of Hu et al.; `hu-online`: the same, which goes on
learning; `oracle`: knows the true motion; `none`: never moves; `rrt`: tries at random."""
LEARNED: tuple[ControllerName, ...] = ("deformernet", "hu", "hu-online")
"""Controllers that have a network."""
GraspName = Literal["truth", "keypoints", "regressor", "dense", "displaced", "farthest"]
"""`truth`: the point at which the goal was made; `keypoints`: where those are that move most;
`regressor`, `dense`: networks that answer with a position, or with a score for each point;
`displaced`: the point farthest from the goal cloud; `farthest`: the one farthest from the truth,
as bad as can be."""

RANDOM = "random"
RUN = "run.mcap"
RECORDING = "run.rrd"
LATENCY = "latency.jsonl"
REFUSED = "refused.json"


@dataclass(frozen=True)
class Trial:
    """One servo run."""

    goal: str
    """`EPISODE[:FRAME]`, a cloud file, `random`, or `random:SEED`."""
    out: Path
    """Directory for it."""
    controller: ControllerName = "deformernet"
    checkpoint: Path | None = None
    """Of the network; None for the one that ships."""
    grasp: GraspName = "truth"
    grasp_checkpoint: Path | None = None
    """Of a network that chooses the grasp; None for the one that ships."""
    scene: Path | None = None
    """Episode whose scene a cloud file is a goal in; None draws one from the seed."""
    settings: ServoSettings = field(default_factory=ServoSettings)
    laboratory: LaboratorySettings = field(default_factory=LaboratorySettings)
    occlusion: bool = True
    """Whether the arms are in the camera's view."""
    dropped: float = 0.0
    """Share of the camera's images that are lost."""
    seed: int = 0
    """Of everything drawn at random."""
    recording: bool = True
    """Whether to write `run.rrd`, besides `run.mcap`."""

    @property
    def goal_name(self) -> str:
        """What the goal is called in names of files."""
        path, number = split_goal(self.goal)
        name = self.goal.replace(":", "-") if is_random(self.goal) else path.stem
        return name if number is None or is_random(self.goal) else f"{name}-{number}"


def is_random(goal: str) -> bool:
    """Return whether a goal is to be drawn."""
    return re.fullmatch(rf"{RANDOM}(:\d+)?", goal) is not None


def split_goal(goal: str) -> tuple[Path, int | None]:
    """Return the file and the frame of `EPISODE[:FRAME]`; None for no frame."""
    match = re.fullmatch(r"(.+):(\d+)", goal)
    if match and not Path(goal).exists():
        return Path(match[1]), int(match[2])
    return Path(goal), None
