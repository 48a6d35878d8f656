"""`dnet evaluate grasp`: how far chosen manipulation points are from the true ones."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import Console

    from dnet.evaluation.grasp import Answers, Case
    from dnet.recorders.grasp_recording import GraspCase
    from dnet.servo.displacement_heuristic import DisplacementHeuristic
    from dnet.servo.pickers import Picker


@dataclass(frozen=True)
class Grasp:
    """Let each method choose where to grasp in unseen cases, and compare with the truth.

    A case is the rest shape of an episode and one of its other shapes; the truth is the point at
    which it was grasped. Two baselines stand beside the methods: any point of the surface, and
    the one that is farthest from the goal cloud. OUT gets grasp.md, grasp.csv with every case,
    grasp.png with the best, the median and the worst case of each method, and grasp.rrd with all
    of them (`dnet play OUT/grasp.rrd`).

    Example: dnet evaluate grasp --from-mcap data/paper --out grasp
    """

    from_mcap: Annotated[str | Path, tyro.conf.arg(metavar="DIRECTORY|URL")]
    """Episodes."""
    out: Path | None = None
    """Directory for the table, the cases and the picture."""
    cases: int = 100
    """How many, over all unseen episodes evenly."""
    keypoints: Path | None = None
    """Run of `dnet train --model keypoints`; the network that ships, unless given."""
    regressor: Path | None = None
    """Run of `dnet train --model grasp`; the network that ships, unless given."""
    dense: Path | None = None
    """Run of `dnet train --model dense`; the network that ships, unless given."""
    validation: float = 0.1
    """Share of the episodes that the networks were not trained on; 1 for all of them, where the
    networks are of other data. (Those that ship: 0.1 of seed 0.)"""
    seed: int = 0
    """Of the division into seen and unseen episodes, and of which shapes are taken."""

    def run(self) -> None:
        """Choose, with a progress bar, and print the table.

        Raises:
            DnetError: If the networks or the episodes will not do.
        """
        from functools import partial

        from rich.console import Console
        from rich.markdown import Markdown

        from dnet.commands.progress import progress
        from dnet.evaluation.grasp import answers_of, table_of
        from dnet.packages import require

        if self.out is not None:
            require("rerun", f"{self.out / 'grasp.rrd'}")  # now, and not when all is judged
        console = Console(stderr=True)
        cases = self._cases(console)
        pickers = self._pickers()
        answers = {}
        with progress(console, "cases") as bar:
            for name, picker in pickers.items():
                task = bar.add_task(name, total=len(cases))
                answers[name] = answers_of(picker, cases, on_case=partial(bar.advance, task))
        table = table_of(answers)
        if self.out is not None:
            self._write(self.out, cases, answers, table)
        Console().print(Markdown(table))

    def _cases(self, console: "Console") -> "list[Case]":
        from dnet.commands.index_bar import read_index
        from dnet.datasets.frame_table import settled_frames
        from dnet.datasets.split import split
        from dnet.datasets.stores import as_place
        from dnet.evaluation.grasp import cases_of

        table = settled_frames(read_index(as_place(self.from_mcap), console))
        if self.validation < 1:
            _, unseen = split(table.episodes_seen, fraction=self.validation, seed=self.seed)
            table = table.of_episodes(set(unseen))
        return cases_of(table, self.cases, seed=self.seed)

    def _pickers(self) -> "dict[str, Picker]":
        from dnet.nets.manipulation_point import DensePredictor, PointRegressor
        from dnet.servo.grasp_pickers import MostDisplaced, NetworkPicker, RandomPoint
        from dnet.training.checkpoints import load_kind
        from dnet.weights import DENSE, REGRESSOR

        return {
            "random point": RandomPoint(self.seed),
            "most displaced point": MostDisplaced(),
            "keypoints": self._heuristic(),
            "regressor": NetworkPicker(load_kind(self.regressor or REGRESSOR, PointRegressor)),
            "dense": NetworkPicker(load_kind(self.dense or DENSE, DensePredictor)),
        }

    def _heuristic(self) -> "DisplacementHeuristic":
        from dnet.nets.keypoints import KeypointNet
        from dnet.servo.displacement_heuristic import DisplacementHeuristic
        from dnet.training.checkpoints import load_kind
        from dnet.weights import KEYPOINTS

        return DisplacementHeuristic(load_kind(self.keypoints or KEYPOINTS, KeypointNet).keypoints)

    def _write(
        self, out: Path, cases: "Sequence[Case]", answers: "dict[str, Answers]", table: str
    ) -> None:
        from dnet.evaluation.grasp import frame_of
        from dnet.evaluation.grasp_figure import draw_cases
        from dnet.files.whole_file import write_whole
        from dnet.recorders.grasp_recording import write_grasps

        for name, text in (("grasp.md", table), ("grasp.csv", frame_of(cases, answers))):
            write_whole(out / name, text.encode())
        draw_cases(cases, answers, out / "grasp.png")
        views = [self._view(number, case, answers) for number, case in enumerate(cases)]
        write_grasps(out / "grasp.rrd", views)

    @staticmethod
    def _view(number: int, case: "Case", answers: "dict[str, Answers]") -> "GraspCase":
        from dnet.recorders.grasp_recording import GraspCase

        dense, pairs = (answers[name].choices[number] for name in ("dense", "keypoints"))
        return GraspCase(
            case.name,
            case.initial,
            case.goal,
            {name: found.points[number] for name, found in answers.items()},
            case.truth,
            None if dense is None else dense.scores,
            None if pairs is None else pairs.keypoints,
        )
