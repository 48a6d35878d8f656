"""How long it takes to choose where to grasp, next to one prediction of a motion.

    python -m tests.benchmarks.grasp

Each method chooses for the same pairs of a rest shape and a goal, of boxes recorded anew, with the
networks that ship and on one thread; clouds are new to it at every call, so nothing of them is
cached. Times are processor time; what the first call compiles or loads is left out.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from time import process_time

import numpy as np
import torch
import tyro
from rich.console import Console
from rich.table import Table

import dnet
from dnet.commands.record import Record
from dnet.datasets.frame_table import settled_frames
from dnet.datasets.index import open_index
from dnet.evaluation.grasp import Case, cases_of
from dnet.nets.keypoints import KeypointNet
from dnet.nets.manipulation_point import DensePredictor, PointRegressor
from dnet.servo.displacement_heuristic import DisplacementHeuristic
from dnet.servo.grasp_pickers import MostDisplaced, NetworkPicker
from dnet.servo.pickers import Picker
from dnet.training.checkpoints import load_kind
from dnet.weights import DENSE, KEYPOINTS, REGRESSOR

REPEATS = 3
"""The fastest of so many calls counts, case by case: other work disturbs upwards alone."""


@dataclass(frozen=True)
class Benchmark:
    """Measure every method."""

    episodes: int = 3
    """Boxes."""
    shapes: int = 5
    """Goals of each."""

    def run(self) -> None:
        """Record, measure and print."""
        torch.set_num_threads(1)
        with TemporaryDirectory() as folder:
            out = Path(folder)
            Record(
                out, pairs=self.episodes, shapes=self.shapes, seed=977, world="quasistatic"
            ).run()
            cases = cases_of(settled_frames(open_index(out)), self.episodes * self.shapes)
        network = dnet.load()
        pickers: dict[str, Picker] = {
            "most displaced point": MostDisplaced(),
            "keypoints": DisplacementHeuristic(load_kind(KEYPOINTS, KeypointNet).keypoints),
            "regressor": NetworkPicker(load_kind(REGRESSOR, PointRegressor)),
            "dense": NetworkPicker(load_kind(DENSE, DensePredictor)),
        }
        measured = {"predict, both clouds new": _milliseconds(network.predict, cases)}
        measured |= {name: _milliseconds(one.pick, cases) for name, one in pickers.items()}
        Console(width=100).print(_table(measured))


def _milliseconds(choose: Callable[..., object], cases: Sequence[Case]) -> np.ndarray:
    choose(cases[0].initial, cases[0].goal)
    times = np.empty((REPEATS, len(cases)))
    for row in times:
        for number, case in enumerate(cases):
            # Copies: a goal that is known by its array is not encoded again.
            initial, goal = case.initial.copy(), case.goal.copy()
            began = process_time()
            choose(initial, goal)
            row[number] = process_time() - began
    return 1e3 * times.min(axis=0)


def _table(measured: dict[str, np.ndarray]) -> Table:
    table = Table(title="CPU milliseconds a case, one thread, 2048 points")
    for heading in ("", "median", "worst", "of a prediction"):
        table.add_column(heading, justify="right" if heading else "left")
    base = float(np.median(next(iter(measured.values()))))
    for name, times in measured.items():
        median = float(np.median(times))
        table.add_row(name, f"{median:.0f}", f"{times.max():.0f}", f"{median / base:.2f}x")
    return table


if __name__ == "__main__":
    tyro.cli(Benchmark).run()
