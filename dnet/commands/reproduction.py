"""The stages that reproduce the paper, as command lines, at any scale."""

import math
import shlex
from dataclasses import dataclass
from pathlib import Path

EPISODES, SHAPES = 150, 200
"""Of the paper's data."""
UNSEEN_EPISODES, UNSEEN_SHAPES = 25, 4
"""Of the data that nothing learns from: its 100 shapes are the paper's 100 cases, and the goals."""
UNSEEN_SEED = 1_000
"""Added to the seed of the data, whose poses and grasps are then others."""
HELD_OUT = 0.1
"""Share of the episodes, and of the shapes of the others, that trainings are judged by."""


@dataclass(frozen=True, slots=True)
class Stage:
    """A part of the reproduction that is done as a whole."""

    name: str
    line: str
    """The command, as one would type it."""


@dataclass(frozen=True, slots=True)
class Size:
    """How many things there are of each kind; all work together is proportional to the scale."""

    episodes: int
    shapes: int
    """Of each episode, besides the rest shape."""
    unseen_episodes: int

    @classmethod
    def of(cls, scale: float) -> "Size":
        """Return the size at a scale, which is 1 for that of the paper.

        Episodes and shapes both shrink with the root of the scale, so that their product, the
        number of clouds, shrinks with the scale itself: an epoch is shorter, and there are as many.
        """
        root = math.sqrt(scale)
        return cls(
            max(4, round(EPISODES * root)),
            max(4, round(SHAPES * root)),
            max(2, round(UNSEEN_EPISODES * root)),
        )


def plan(out: Path, scale: float, *, seed: int, workers: int) -> list[Stage]:
    """Return all stages in their order; each takes what those before it left in `out`."""
    size = Size.of(scale)
    # Quoted, as a shell needs names with blanks.
    out = Path(shlex.quote(str(out)))
    data, unseen, runs = out / "data", out / "unseen", out / "runs"

    def record(folder: Path, episodes: int, shapes: int, seed: int) -> str:
        return (
            f"dnet record {folder} --pairs {episodes} --shapes {shapes} --world quasistatic "
            f"--seed {seed} --workers {workers}"
        )

    def train(name: str, options: str) -> Stage:
        line = (
            f"dnet train --from-mcap {data} --out {runs / name} --validation {HELD_OUT} "
            f"--seed {seed} --resume {options}"
        )
        return Stage(name, line)

    begun = f"--weights {runs / 'deformernet'}"
    return [
        Stage("data", record(data, size.episodes, size.shapes, seed)),
        Stage("unseen", record(unseen, size.unseen_episodes, UNSEEN_SHAPES, seed + UNSEEN_SEED)),
        # Epochs and batches are those of the networks that ship, whose cards tell them.
        train("deformernet", "--groups 4 --epochs 70"),
        train("keypoints", f"--model keypoints --epochs 11 {begun}"),
        train("grasp", f"--model grasp --groups 4 --epochs 3 {begun}"),
        train("dense", f"--model dense --groups 4 --epochs 6 {begun}"),
        train("hu", "--model hu --epochs 100"),
        train("hu-linear", "--model hu --no-relu --epochs 100"),
        train(
            "hu-few",
            "--model hu --episodes 1 --choose-by unseen-shapes --groups 2 --epochs 150",
        ),
        Stage(
            "report",
            f"dnet evaluate paper --from-mcap {unseen} --validation 1 --runs {runs} "
            f"--checkpoint {runs / 'deformernet'} --keypoints {runs / 'keypoints'} "
            f"--regressor {runs / 'grasp'} --dense {runs / 'dense'} "
            f"--world quasistatic --scale {min(scale, 1.0)} "
            f"--seed {seed} --jobs {workers} --out {out / 'report'}",
        ),
    ]
