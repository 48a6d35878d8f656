"""`dnet evaluate`: experiments, each a function of logs and a seed."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from dnet.commands.evaluate_grasp import Grasp
from dnet.commands.evaluate_importance import Importance
from dnet.commands.evaluate_keypoints import EvaluateKeypoints
from dnet.commands.evaluate_paper import Paper, list_experiments
from dnet.commands.evaluate_servo import ServoGoals
from dnet.commands.train import Train

if TYPE_CHECKING:
    from dnet.datasets.index import Index
    from dnet.training.settings import PairKind


@dataclass(frozen=True)
class Ablations:
    """Train the network many times, one choice apart, and compare the errors in a table.

    Every training encodes as many clouds; what it comes to on unseen shapes and on unseen episodes
    is written to OUT/ablations.md. Each is a run of its own in OUT, whose config.json tells all
    options. Stopped, the same call goes on.

    Example: dnet evaluate ablations --from-mcap data/paper --out ablations
    """

    from_mcap: Annotated[str | Path, tyro.conf.arg(metavar="DIRECTORY|URL")]
    """Episodes."""
    out: Path
    """Directory for the runs and the table."""
    encodings: int = 60_000
    """Clouds that each training encodes: twice a pair, or once for all pairs of a group."""
    only: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(metavar="NAME")] = ()
    """Train these alone; repeated. The table tells their names."""
    validation: float = 0.15
    """Share of the episodes to hold out, and of the shapes of the others."""
    seed: int = 0
    """Of every training."""

    def run(self) -> None:
        """Train whatever is not there yet, and print the table.

        Raises:
            DnetError: If the episodes or the directory will not do, or a name is unknown.
            KeyboardInterrupt: After Ctrl-C; the same call goes on.
        """
        from rich.console import Console
        from rich.markdown import Markdown

        from dnet.commands.index_bar import read_index
        from dnet.datasets.stores import as_place
        from dnet.errors import TooFew, UnknownAblation
        from dnet.evaluation.ablations import ABLATIONS, read_ablation, table_of
        from dnet.files.whole_file import write_whole
        from dnet.training.run import is_finished

        for name in self.only:
            if name not in ABLATIONS:
                raise UnknownAblation(name, list(ABLATIONS))
        if self.encodings < 1:
            raise TooFew("--encodings", self.encodings, 1)
        found = []
        console = Console(stderr=True)
        index = read_index(as_place(self.from_mcap), console)
        for number, name in enumerate(names := self.only or tuple(ABLATIONS), start=1):
            console.print(f"[bold]{number}/{len(names)} {name}[/bold]", highlight=False)
            run = self.out / name.replace(",", "").replace(" ", "-")
            if not is_finished(run):
                self._train(run, name, index)
            found.append(read_ablation(name, run))
        table = table_of(found)
        write_whole(self.out / "ablations.md", table.encode())
        Console().print(Markdown(table))

    def _epochs(self, index: "Index", pairs: "PairKind") -> float:
        """Return how many epochs it takes to encode as many clouds as are wanted."""
        from dnet.training.division import divide, pairs_of

        table = divide(index, fraction=self.validation, seed=self.seed).training
        an_epoch = {
            "all": len(table),
            "any": 2 * pairs_of(table),
            "rest": 2 * int((~table.rest).sum()),
        }
        return self.encodings / an_epoch[pairs]

    def _train(self, run: Path, name: str, index: "Index") -> None:
        from dataclasses import replace

        from dnet.evaluation.ablations import ABLATIONS

        plain = Train(
            self.from_mcap,
            run,
            resume=True,
            epochs=self._epochs(index, ABLATIONS[name].get("pairs", "all")),
            validation=self.validation,
            seed=self.seed,
        )
        replace(plain, **ABLATIONS[name]).run()


@dataclass(frozen=True)
class Network:
    """Judge a trained network, whatever its kind, on all pairs of a dataset's settled frames.

    The dataset may be any: other objects, another world, other people's clouds. With --validation
    it is parted as `dnet train` parts one, by hashes of episodes and shapes, and each part is
    judged by itself: the same seeds recorded in another world are parted alike.

    Example: dnet evaluate network --checkpoint runs/paper --from-mcap data/organs
    """

    from_mcap: Annotated[str | Path, tyro.conf.arg(metavar="DIRECTORY|URL")]
    """Episodes."""
    checkpoint: Path | None = None
    """Directory of `dnet train`, or one of its .safetensors files; the DeformerNet that ships,
    unless given."""
    validation: float | None = None
    """Share that the training held out; what it learned from, unseen shapes and unseen episodes
    are then judged apart. (The networks that ship: 0.1.)"""
    seed: int = 0
    """Of that division."""
    json: tyro.conf.FlagCreatePairsOff[bool] = False
    """Print JSON instead of a table."""

    def run(self) -> None:
        """Judge, with a progress bar, and print the errors.

        Raises:
            DnetError: If the network or the episodes will not do.
        """
        from dataclasses import asdict
        from functools import partial
        from json import dumps

        from rich.console import Console

        from dnet.commands.index_bar import read_index
        from dnet.commands.progress import progress
        from dnet.commands.training_screen import error_table
        from dnet.datasets.frame_table import settled_frames
        from dnet.datasets.stores import as_place
        from dnet.training.checkpoints import load_any
        from dnet.training.division import divide
        from dnet.training.frames import Frames
        from dnet.training.tasks import task_of
        from dnet.weights import DEFORMERNET

        console = Console(stderr=True)
        model = load_any(self.checkpoint or DEFORMERNET)
        judged_by = task_of(model)
        index = read_index(as_place(self.from_mcap), console)
        if self.validation is None:
            name = str(self.from_mcap).rstrip("/").rsplit("/", 1)[-1]
            parts = {name: settled_frames(index)}
        else:
            parts = divide(index, fraction=self.validation, seed=self.seed).parts
        errors = {}
        with progress(console, "clouds") as bar:
            for name, table in parts.items():
                frames = Frames.of(table, model.config)
                task = bar.add_task(f"describing, {name}", total=len(table))
                frames.tables.build(on_clouds=partial(bar.advance, task))
                task = bar.add_task(f"judging, {name}", total=len(table))
                errors[name] = judged_by.judge(model, frames, on_clouds=partial(bar.advance, task))
        if self.json:
            told = {part: found and asdict(found) for part, found in errors.items()}
            (alone, *others) = told.values()
            print(dumps(told if others else alone, indent=2))
        else:
            Console().print(error_table(errors, title="errors", zero=judged_by.zero))


@dataclass(frozen=True)
class Evaluate:
    """Reproduce the paper, or measure a network, keypoints, grasps, servo runs, or trainings.

    Example: dnet evaluate --list

    Example: dnet evaluate paper --out report --scale 0.02

    Example: dnet evaluate network --checkpoint runs/paper --from-mcap data/organs
    """

    experiment: tyro.conf.OmitSubcommandPrefixes[
        Annotated[Paper, tyro.conf.subcommand("paper")]
        | Annotated[Network, tyro.conf.subcommand("network")]
        | Annotated[Grasp, tyro.conf.subcommand("grasp")]
        | Annotated[ServoGoals, tyro.conf.subcommand("servo")]
        | Annotated[Importance, tyro.conf.subcommand("importance")]
        | Annotated[EvaluateKeypoints, tyro.conf.subcommand("keypoints")]
        | Annotated[Ablations, tyro.conf.subcommand("ablations")]
        | Annotated[None, tyro.conf.subcommand("list", description="The same as --list.")]
    ] = None
    list: tyro.conf.FlagCreatePairsOff[bool] = False
    """Tell which experiments `paper` consists of: what each reproduces, needs and costs."""

    def run(self) -> None:
        """Run the experiment."""
        if self.experiment is None or self.list:
            list_experiments()
        else:
            self.experiment.run()
