"""The directory of one training: its config, its networks, a line an epoch, where to go on."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Literal

from dnet.errors import BadCheckpoint, OccupiedOutput, OtherRun, OtherStream, TooLarge
from dnet.files.sizes import LARGEST_JSON, parse_json, read_at_most, read_json
from dnet.files.whole_file import write_whole
from dnet.training.checkpoints import BEST, read_tensors, save, write_json, write_tensors
from dnet.training.objectives import Network
from dnet.training.progress import EpochDone
from dnet.training.scores import Errors
from dnet.training.training import Training

LAST, CONFIG, METRICS, STATE, ERRORS = (
    "last.safetensors",
    "config.json",
    "metrics.jsonl",
    "state.safetensors",
    "errors.json",
)


ChosenBy = Literal["unseen_episodes", "unseen_shapes"]
"""Held-out frames that a network can be chosen by."""

EXTENSIBLE = ("epochs", "minutes")
"""What a training may go on with otherwise than it began: the schedule follows the new end."""


class RunWriter:
    """Writes a training down as it goes.

    The directory is made with the first thing that is worth keeping.

    Args:
        path: The run directory.
        content: What shaped the training, as JSON.
        resume: Whether to go on with the training that `path` holds, if it does.
        chosen_by: The frames that the best network is best on.

    Raises:
        OccupiedOutput: If `path` holds a run and is not to be gone on with, or is a file.
        OtherRun: If it holds a training with other settings or other data.
        BadCheckpoint: If what it holds cannot be read.
    """

    def __init__(
        self,
        path: Path,
        content: Mapping[str, Any],
        *,
        resume: bool = False,
        chosen_by: ChosenBy = "unseen_episodes",
    ) -> None:
        self.path = path
        self.history: list[dict[str, Any]] = []
        """What was written of each epoch."""
        self.chosen_by: ChosenBy = chosen_by
        """The frames that the best network is best on."""
        self.content = json.loads(json.dumps(content))
        self._state: tuple[dict[str, Any], Any] | None = None
        if path.exists() and not path.is_dir():
            raise OccupiedOutput(path, "a file")
        held = [name for name in (BEST, LAST, CONFIG, METRICS, STATE) if (path / name).exists()]
        if held and not resume:
            raise OccupiedOutput(path, f"a run ({', '.join(held)}); --resume goes on with it")
        if STATE in held:
            self._resume()

    @property
    def best(self) -> Mapping[str, Any] | None:
        """The best epoch so far, as it was written down; None before the first."""
        return best_of(self.history, by=self.chosen_by)

    @property
    def least(self) -> float:
        """The smallest error so far on the frames that the network is chosen by, in mm²."""
        best = self.best
        return math.inf if best is None else main_scores(best[self.chosen_by])["mse_mm2"]

    def take_up(self, training: Training) -> bool:
        """Put `training` where the run was put down; return whether there was anything.

        Raises:
            OtherStream: If that was with other data.
            BadCheckpoint: If it does not fit the network.
        """
        if self._state is None:
            return False
        facts, tensors = self._state
        try:
            training.load(tensors, facts["training"])
        except OtherStream:
            raise
        except (KeyError, TypeError, ValueError, RuntimeError) as error:
            raise BadCheckpoint(
                self.path / STATE, f"does not fit this training ({error})", "train anew"
            ) from error
        return True

    def add(self, done: EpochDone, network: Network) -> None:
        """Write down an epoch and the network that it left."""
        metrics = asdict(done)
        if done.best:
            save(self.path / BEST, network, metrics=metrics)
        save(self.path / LAST, network, metrics=metrics)
        self.history.append(json.loads(json.dumps(metrics)))
        self._write_history()

    def add_errors(self, errors: Mapping[str, Errors | None]) -> None:
        """Write down the errors of the best network on everything, by what they are on."""
        found = {name: asdict(of) for name, of in errors.items() if of is not None}
        write_json(self.path / ERRORS, found)

    def save(self, training: Training) -> None:
        """Put the training down, so that it can be taken up from here."""
        write_json(self.path / CONFIG, self.content)
        facts = {"epochs": len(self.history), "training": training.facts()}
        write_tensors(self.path / STATE, training.tensors(), facts)

    def _resume(self) -> None:
        before = read_config(self.path)
        for part in ("network", "training", "data"):
            for name, value in self.content[part].items():
                held = before[part] if isinstance(before.get(part), dict) else {}
                if name not in EXTENSIBLE and held.get(name) != value:
                    raise OtherRun(self.path, name, held.get(name), value)
        facts, tensors = read_tensors(self.path / STATE)
        if type(facts.get("epochs")) is not int or facts["epochs"] < 0:
            raise BadCheckpoint(self.path / STATE, "does not say how far it is", "train anew")
        # Epochs since then come again, and come out the same.
        self.history = read_history(self.path)[: facts["epochs"]] if facts["epochs"] else []
        self._state = facts, tensors

    def _write_history(self) -> None:
        """Write the config and all epochs, each file whole or not at all."""
        write_json(self.path / CONFIG, self.content)
        lines = "".join(json.dumps(line) + "\n" for line in self.history)
        write_whole(self.path / METRICS, lines.encode())


def best_of(
    history: Sequence[Mapping[str, Any]], *, by: ChosenBy = "unseen_episodes"
) -> Mapping[str, Any] | None:
    """Return the epoch whose network was best on some frames, as it was written down."""
    return min(history, key=lambda line: main_scores(line[by])["mse_mm2"], default=None)


def main_scores(errors: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the scores that networks are chosen by, out of errors as they were written down."""
    return errors["any_pair"] or errors["from_rest"]


def is_finished(run: Path) -> bool:
    """Return whether the training in a directory has come to its end."""
    try:
        last = read_history(run)[-1]
        return (run / ERRORS).exists() and last["progress"] >= 1
    except (BadCheckpoint, KeyError, TypeError, IndexError):
        return False


def read_history(run: Path) -> list[dict[str, Any]]:
    """Return what was written down of each epoch of the training in a directory.

    Raises:
        BadCheckpoint: If that cannot be read.
        TooLarge: If it is longer than any training.
    """
    file = run / METRICS
    try:
        content = read_at_most(file, LARGEST_JSON, what="history")
        return [parse_json(line) for line in content.decode("utf-8").splitlines()]
    except TooLarge:
        raise
    except (OSError, ValueError) as error:
        raise BadCheckpoint(file, f"is unreadable ({error})", "train it again") from error


def read_config(run: Path) -> dict[str, Any]:
    """Return what shaped the training of a run directory.

    `["data"]["unseen_episodes"]` names the episodes that the network was not trained on.

    Raises:
        BadCheckpoint: If the directory holds no config, or a corrupt one.
        TooLarge: If it is larger than any config.
    """
    file = run / CONFIG
    try:
        content = read_json(file, what="config")
    except TooLarge:
        raise
    except FileNotFoundError as error:
        raise BadCheckpoint(file, "does not exist", "give a run of `dnet train`") from error
    except (OSError, ValueError) as error:
        raise BadCheckpoint(file, f"is unreadable ({error})", "train it again") from error
    if not isinstance(content, dict):
        raise BadCheckpoint(file, "is not a JSON object", "train it again")
    return content
