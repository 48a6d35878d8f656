"""What a report is asked to be made of, and what each experiment writes down of that."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

from rich.console import Console

from dnet.evaluation.report.asked import Asked
from dnet.evaluation.report.networks_section import best_of
from dnet.evaluation.report.trainings import read_training
from dnet.laboratory import SHAPING
from dnet.training.checkpoints import weights_file
from dnet.training.run import is_finished, read_config
from dnet.weights import DENSE, HU, KEYPOINTS, REGRESSOR

MODELS = ("deformernet", "hu")
VERSIONS = (*SHAPING, "torch")


@dataclass(frozen=True)
class PaperRequest:
    """All that decides about the experiments."""

    out: Path
    """Directory of the report; each experiment has one in it."""
    from_mcap: Path | None = None
    """Episodes to take cases and goals from; None to record them."""
    validation: float = 0.1
    """Share of them that the networks were not trained on."""
    runs: Path | None = None
    """Directory of trainings."""
    checkpoint: Path | None = None
    """The DeformerNet to drive with; None for the one that ships."""
    grasps: Mapping[str, Path] = field(default_factory=dict)
    """The networks that choose where to grasp, by the name of their method; those that are not
    here are the ones that ship."""
    world: Literal["bullet", "quasistatic"] = "bullet"
    """Where the cases of the paper happen, and the two manipulation points."""
    scale: float = 1.0
    jobs: int = 1
    seed: int = 0
    console: Console = field(default_factory=lambda: Console(stderr=True), repr=False)

    def count(self, full: int) -> int:
        """Return how many of the paper's number to do."""
        return max(1, round(full * self.scale))

    @cached_property
    def trainings(self) -> dict[str, Path]:
        """The finished trainings of DeformerNet and of Hu et al. that were given, by name."""
        if self.runs is None:
            return {}
        there = sorted(path for path in self.runs.iterdir() if path.is_dir())
        return {
            path.name: path
            for path in there
            if is_finished(path) and read_config(path)["network"]["model"] in MODELS
        }

    @cached_property
    def hu(self) -> Path | None:
        """The network of Hu et al. to drive with: the best that is of all episodes.

        None for the one that ships.
        """
        read = {name: read_training(path) for name, path in self.trainings.items()}
        best = best_of(list(read.values()), "hu", few=False)
        return None if best is None else self.trainings[best.name]

    def asked(
        self,
        full: int,
        *,
        count: int | None = None,
        weights: Mapping[str, Path],
        data: Mapping[str, str],
        options: Mapping[str, Any] | None = None,
        runs: Mapping[str, tuple[str, ...]] | None = None,
    ) -> Asked:
        """Return what an experiment is to write down before it begins."""
        return Asked(
            count=self.count(full) if count is None else count,
            full=full,
            seed=self.seed,
            scale=self.scale,
            versions={name: version(name) for name in VERSIONS},
            weights={name: digest(path) for name, path in weights.items()},
            data=dict(data),
            options=dict(options or {}),
            runs=dict(runs or {}),
        )


def hu_weights(request: PaperRequest) -> Path:
    """Return the file of the network of Hu et al. that is driven with."""
    return HU if request.hu is None else weights_file(request.hu)


def grasp_weights(request: PaperRequest) -> dict[str, Path]:
    """Return the file of each network that chooses where to grasp, by the name of its method."""
    own = {name: weights_file(run) for name, run in request.grasps.items()}
    return {"keypoints": KEYPOINTS, "regressor": REGRESSOR, "dense": DENSE} | own


def digest(path: Path) -> str:
    """Return the beginning of the SHA-256 of a file."""
    return hashlib.sha256(path.read_bytes()).hexdigest()[:16]
