"""What each choice in the network and its training is worth, by trainings one choice apart."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from dnet.errors import BadCheckpoint
from dnet.files.sizes import read_json
from dnet.training.run import ERRORS, read_history

ABLATIONS: Mapping[str, Mapping[str, Any]] = {
    "as by default": {},
    "BatchNorm": {"norm": "batch"},
    "without density": {"density": False},
    "1024 points": {"points": 1024},
    "512 points": {"points": 512},
    "any two, single pairs": {"pairs": "any"},
    "from rest, single pairs": {"pairs": "rest"},
    "world coordinates": {"coordinates": "world"},
    "centred coordinates": {"coordinates": "centred"},
    "without augmentation": {"augment": False},
    "size of the paper": {"size": "paper"},
}
"""Options of `dnet train` that are changed, by what the change is called."""

_COLUMNS = (
    "training",
    "encodings",
    "unseen shapes, any two",
    "from rest",
    "unseen episodes, any two",
    "from rest",
)


@dataclass(frozen=True, slots=True)
class Ablation:
    """What one training came to: squared errors are means over x, y, z in mm²."""

    name: str
    encodings: int
    """Clouds that were encoded while learning."""
    seen_any: float
    """Error on unseen shapes of seen episodes, of any two frames."""
    seen_rest: float
    """The same from the rest shape."""
    unseen_any: float
    """Error on unseen episodes, of any two frames."""
    unseen_rest: float

    @property
    def cells(self) -> tuple[str, ...]:
        """The row of a table."""
        errors = (self.seen_any, self.seen_rest, self.unseen_any, self.unseen_rest)
        return (self.name, f"{self.encodings:,}", *(f"{error:.1f}" for error in errors))


def read_ablation(name: str, run: Path) -> Ablation:
    """Return what the training in the directory `run` came to.

    Raises:
        BadCheckpoint: If it is not finished, or unreadable.
    """
    try:
        errors = read_json(run / ERRORS, what="errors of a training")
        last = read_history(run)[-1]
        shapes, episodes = errors["unseen shapes"], errors["unseen episodes"]
        return Ablation(
            name,
            int(last["encodings"]),
            *(
                float(of[pairs]["mse_mm2"])
                for of in (shapes, episodes)
                for pairs in ("any_pair", "from_rest")
            ),
        )
    except (OSError, ValueError, KeyError, TypeError, IndexError) as error:
        raise BadCheckpoint(
            run, f"is not a finished training ({error!r})", "run the ablations again"
        ) from error


def table_of(ablations: Sequence[Ablation]) -> str:
    """Return a Markdown table."""
    rows = [_COLUMNS, ("---", *["---:"] * (len(_COLUMNS) - 1)), *(one.cells for one in ablations)]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)
