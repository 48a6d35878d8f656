"""Trainings that an experiment was given: what each is of, and its errors, as it wrote them."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dnet.errors import BadReport
from dnet.files.sizes import read_json

CONFIG, ERRORS = "config.json", "errors.json"
"""Names of a training's own files: copies of them are kept with the experiment."""
SHIPPED, SHIPPED_HU = "shipped", "shipped-hu"
"""Directories of the networks that ship, whose errors the experiment finds itself."""


@dataclass(frozen=True, slots=True)
class Errors:
    """Of one network, on one set of frames and pairs."""

    part: str
    """`training`, `unseen shapes` or `unseen episodes`."""
    pairs: str
    """`any two` frames of an episode, or `rest to shape`."""
    count: int
    mse_mm2: float
    """Squared error, mean over pairs and over x, y, z."""
    sum_mm2: float
    """The same, summed over x, y, z."""
    mean_mm: float
    """Mean Euclidean error."""
    zero_mse_mm2: float
    """`mse_mm2` of no motion."""


@dataclass(frozen=True, slots=True)
class Training:
    """One training, or the network that ships."""

    name: str
    model: str
    """`deformernet` or `hu`."""
    few: bool
    """Whether it was on a few episodes alone."""
    points: int
    """Of the clouds that it sees."""
    detail: str
    """What sets it apart from others of its model."""
    errors: tuple[Errors, ...]

    @property
    def shipped(self) -> bool:
        """Whether it ships: its errors are the experiment's own, on some of the frames."""
        return self.name.startswith(SHIPPED)

    def error(self, part: str, pairs: str = "any two") -> Errors | None:
        """Return the errors on one set of frames and pairs, where they are known."""
        found = (one for one in self.errors if (one.part, one.pairs) == (part, pairs))
        return next(found, None)


def read_trainings(folder: Path) -> list[Training]:
    """Return the trainings whose copies are in a directory, by name; those that ship first.

    Raises:
        BadReport: If one cannot be read.
    """
    runs = sorted(path.parent for path in folder.glob(f"*/{ERRORS}"))
    return [
        read_training(run) for run in sorted(runs, key=lambda run: not run.name.startswith(SHIPPED))
    ]


def read_training(run: Path) -> Training:
    """Return what a training in a directory is of, and its errors.

    Raises:
        BadReport: If it cannot be read.
    """
    try:
        errors = read_json(run / ERRORS, what="errors of a training")
        config = read_json(run / CONFIG, what="config of a training")
        network, learned = config["network"], config["training"]
        few = learned.get("episodes") is not None
        return Training(
            run.name,
            str(network["model"]),
            few,
            int(network["points"]),
            _detail(network, config.get("data", {}), few=few),
            tuple(
                Errors(
                    part,
                    pairs,
                    int(of[key]["pairs"]),
                    *(
                        float(of[key][name])
                        for name in ("mse_mm2", "sum_mm2", "mean_mm", "zero_mse_mm2")
                    ),
                )
                for part, of in errors.items()
                for key, pairs in (("any_pair", "any two"), ("from_rest", "rest to shape"))
                if of[key] is not None
            ),
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise BadReport(run, f"is no finished training ({error!r})", "remove it") from error


def _detail(network: Mapping[str, Any], data: Mapping[str, Any], *, few: bool) -> str:
    frames = data.get("frames", {}).get("training")
    told = [
        f"{frames} frames" if frames else "",
        "a few episodes" if few else "",
        f"{network['points']} points",
    ]
    if network["model"] == "hu":
        told.append("ReLU" if network.get("relu", True) else "linear")
    else:
        told.append(f"size {network.get('size', '?')}")
    return ", ".join(one for one in told if one)
