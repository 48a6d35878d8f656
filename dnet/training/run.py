"""The directory of one training: its config, its best and last weights, a line for every epoch."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from dnet.errors import BadCheckpoint, OccupiedOutput
from dnet.nets.deformernet import DeformerNet, DeformerNetConfig
from dnet.training.checkpoints import BEST, save, write_json
from dnet.training.loop import EpochDone, Result

LAST, CONFIG, METRICS = "last.safetensors", "config.json", "metrics.jsonl"


class RunWriter:
    """Writes a training down as it goes.

    The directory is made with the first epoch: a training that never got there leaves none.

    Args:
        path: The run directory.
        content: What shaped the training, as JSON.

    Raises:
        OccupiedOutput: If `path` holds a run, or is a file.
    """

    def __init__(self, path: Path, content: Mapping[str, Any]) -> None:
        self.path = path
        self._content = content
        self._began = False
        if path.exists() and not path.is_dir():
            raise OccupiedOutput(path, "a file")
        held = [name for name in (BEST, LAST, CONFIG, METRICS) if (path / name).exists()]
        if held:
            raise OccupiedOutput(path, f"a run ({', '.join(held)})")

    def add(self, done: EpochDone, model: DeformerNet) -> None:
        """Write down an epoch and the weights that it left."""
        if not self._began:
            write_json(self.path / CONFIG, self._content)
            self._began = True
        metrics = asdict(done)
        # Written as it goes, so that a crash loses the epoch under way alone.
        with (self.path / METRICS).open("a", encoding="utf-8") as file:
            file.write(json.dumps(metrics) + "\n")
        weights = model.state_dict()
        if done.best:
            save(self.path / BEST, weights, config=model.config, metrics=metrics)
        save(self.path / LAST, weights, config=model.config, metrics=metrics)

    def finish(self, result: Result, config: DeformerNetConfig) -> None:
        """Write everything once more, in case an interrupt came in the middle of `add`."""
        best = min(result.history, key=lambda done: done.validation.any_pair.mse_mm2)
        write_json(self.path / CONFIG, self._content)
        lines = [json.dumps(asdict(done)) + "\n" for done in result.history]
        (self.path / METRICS).write_text("".join(lines), encoding="utf-8")
        save(self.path / BEST, result.best, config=config, metrics=asdict(best))
        save(self.path / LAST, result.last, config=config, metrics=asdict(result.history[-1]))


def read_config(run: Path) -> dict[str, Any]:
    """Return what shaped the training of a run directory.

    `["data"]["validation"]` names the episodes that the network was not trained on.

    Raises:
        BadCheckpoint: If the directory holds no config, or a corrupt one.
    """
    file = run / CONFIG
    try:
        content = json.loads(file.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise BadCheckpoint(file, "does not exist", "give a run of `dnet train`") from error
    except (OSError, ValueError, RecursionError) as error:
        raise BadCheckpoint(file, f"is unreadable ({error})", "train it again") from error
    if not isinstance(content, dict):
        raise BadCheckpoint(file, "is not a JSON object", "train it again")
    return content
