"""`dnet train`: learn from recorded episodes how far the grasp must move."""

import math
from contextlib import nullcontext
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import tyro

if TYPE_CHECKING:
    import torch
    from rich.console import Console

    from dnet.training.division import Division
    from dnet.training.frames import Config, Frames
    from dnet.training.parallel import Process
    from dnet.training.run import RunWriter
    from dnet.training.settings import TrainingSettings
    from dnet.training.training import Training

WATCHED = 2000
"""Frames of each held-out set that are judged after every epoch; all of them are at the end."""


@dataclass(frozen=True)
class Train:
    """Train a network on episodes and keep the one that judges unseen episodes best.

    DeformerNet sees two settled frames of an episode and learns the motion of the grasp between
    them. The networks that choose where to grasp see the rest shape and another one, and learn
    the manipulation point. Some episodes are held out, and some shapes of the others, to judge
    by. Clouds are read from the logs as they are needed.

    The run directory gets best.safetensors and last.safetensors, each of which is enough for
    `dnet servo`, a model card, metrics.jsonl (a line an epoch), training.rrd (for `dnet play`),
    config.json, and state.safetensors, from which --resume goes on. Ctrl-C stops after the batch
    under way and keeps everything; a kill loses five minutes at most.

    Example: dnet train --from-mcap data/small --out runs/small --epochs 200

    On several processes or machines: torchrun --nproc-per-node 2 --no-python dnet train ...
    """

    from_mcap: Annotated[str | Path, tyro.conf.arg(metavar="DIRECTORY|URL")]
    """Episodes of `dnet record`, two or more; read from where they lie, be it an object store."""
    out: Path
    """Directory for the run; made if need be, must hold none yet, unless --resume is given."""
    model: Literal["deformernet", "hu", "grasp", "dense", "keypoints"] = "deformernet"
    """`deformernet`: the motion from one cloud to another; `hu`: the same from features made by
    hand, after Hu et al. 2019, to compare with; `grasp`: where to grasp, as a position; `dense`:
    where to grasp, as a score for each point; `keypoints`: which point is which, from clouds
    alone."""
    resume: tyro.conf.FlagCreatePairsOff[bool] = False
    """Go on with the training in --out, exactly where it was put down; begin it if there is
    none. All options must be as they were, but for --epochs and --minutes: with more of them a
    training goes on longer, its learning rate that of the new schedule."""
    weights: Annotated[str | None, tyro.conf.arg(metavar="PATH|shipped|random")] = None
    """What to begin with: a run, a .safetensors file, the network that `shipped`, or `random`
    weights. A DeformerNet and `hu` begin with random ones, unless given, the others with what the
    DeformerNet that shipped knows: `dense` with all of it, `grasp` and `keypoints` with its
    encoder. Options of the network must be those that it has, but for --points."""
    epochs: int | float = 100
    """How often every frame is seen, or every pair with other --pairs (paper: 100, of 30,000
    frames)."""
    minutes: float | None = None
    """Stop in this time even so. The schedule then follows the clock, and a second training on
    the same data ends in slightly different weights."""
    pairs: Literal["all", "any", "rest"] = "all"
    """`all` pairs of the clouds of a group, each encoded once; `any` two frames, drawn one pair
    at a time; from `rest` to another shape, as in the paper."""
    size: Literal["light", "paper"] = "light"
    """Levels of the encoder; `paper` takes seven times as long."""
    norm: Literal["group", "batch"] = "group"
    """Normalisation; `batch` is what the paper states."""
    coordinates: Literal["scaled", "centred", "world"] = "scaled"
    """How the network sees clouds: in units of 0.1 m, about the `world`'s origin or `centred` on
    the object; or in metres, as in the paper."""
    density: bool = True
    """Weigh features by how crowded their points are."""
    relu: bool = True
    """Of `hu`: a ReLU after each layer but the last; without, it is a linear map."""
    points: int | None = None
    """Points of each cloud to take, the farthest from each other; all, unless given."""
    schedule: Literal["cosine", "step"] = "cosine"
    """Of the learning rate: `cosine` to zero, or a `step` of 1/10 every 50 epochs (paper)."""
    learning_rate: float | None = None
    """Of Adam, at its highest (paper: 0.001); 0.002 unless given, 0.003 for `keypoints`, 0.01 for
    `hu`."""
    groups: int | None = None
    """Groups in a batch, over all processes, each of another episode as a rule; 2 unless given, 3
    for `keypoints`, 4 for `hu`."""
    frames: int | None = None
    """Clouds in a group; 8 unless given, 4 for `keypoints`. 2 groups of 8 are 16 encodings and 112
    pairs."""
    rest_share: float | None = None
    """Share of the groups that the rest shape joins: it is one frame of very many, and where
    every servo run begins. 0.25 unless given, 0.5 for `keypoints`."""
    augment: bool = True
    """Turn and shift each group of frames about the table at random. Those of `keypoints` and `hu`
    always stay where they are: what judges keypoints is how clouds differ, and their encoder knows
    of turns; the features of `hu` are blind to turns."""
    validation: float = 0.15
    """Share of the episodes to hold out, at least one, and of the shapes of the others."""
    episodes: int | None = None
    """Learn from so many episodes alone, the first ones by id, such as 1 for the shapes of one
    object and one grasp; what is held out of the others stays the same."""
    choose_by: Literal["unseen-episodes", "unseen-shapes"] = "unseen-episodes"
    """Keep the network that is best on these; of a training on few episodes, unseen shapes."""
    seed: int = 0
    """Of the division, the first weights, the order and the augmentation."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """Where to train; `auto` takes a GPU if there is one."""
    precision: Literal["auto", "float32", "bfloat16"] = "auto"
    """Of activations; `auto` takes bfloat16 on a GPU that computes with it."""
    workers: int = 0
    """Processes that read ahead; none is fastest on a CPU. The order is the same with any."""
    tensorboard: tyro.conf.FlagCreatePairsOff[bool] = False
    """Also write RUN/tensorboard (pip install "deformernet[tensorboard]")."""

    def run(self) -> None:
        """Train, with a progress bar, and print the errors.

        Raises:
            DnetError: If the episodes, the output directory or an option will not do.
            KeyboardInterrupt: After Ctrl-C; what was learned is kept.
        """
        from rich.console import Console

        from dnet.files.one_writer import one_writer
        from dnet.training.allocation import kept_pages
        from dnet.training.determinism import repeatable
        from dnet.training.parallel import meeting, this_process

        self._check()
        process = this_process()
        device = self._device(process)
        console = Console(stderr=True, quiet=not process.first)
        with (
            kept_pages(),
            repeatable(),
            meeting(process, device),
            one_writer(self.out) if process.first else nullcontext(),
        ):
            self._train(process, device, console)

    def _train(self, process: "Process", device: "torch.device", console: "Console") -> None:
        from rich.console import Console

        from dnet.commands.index_bar import read_index
        from dnet.commands.training_end import finish
        from dnet.commands.training_screen import show_data
        from dnet.datasets.stores import as_place
        from dnet.training.division import divide
        from dnet.training.run import ChosenBy, RunWriter
        from dnet.training.tasks import TASKS

        if not process.first:
            process.wait()  # for the index and the tables that the first one makes
        index = read_index(as_place(self.from_mcap), console)
        division = divide(index, fraction=self.validation, seed=self.seed, episodes=self.episodes)
        config = self._network(division.training.points)
        settings = self._settings(device)
        content = self._describe(division, config, settings)
        chosen_by: ChosenBy = (
            "unseen_shapes" if self.choose_by == "unseen-shapes" else "unseen_episodes"
        )
        run = RunWriter(self.out, content, resume=self.resume, chosen_by=chosen_by)
        frames = _prepared(division, config, console)
        if process.first:
            process.wait()
        show_data(console, division, frames, target=TASKS[self.model].target)
        training = self._begin(frames, config, settings, device=device, process=process)
        resumed = run.take_up(training)
        if resumed:
            console.print(f"going on after {training.steps} batches, {training.seconds:.0f} s")
        self._fit(training, division, frames=frames, run=run, console=console)
        if process.first:
            finish(training, division, run=run, frames=frames, console=console, out=Console())
        if training.stopped and training.progress < 1:
            raise KeyboardInterrupt

    def _check(self) -> None:
        from dnet.errors import TooFew, TooShort, UnusedOption

        for what, value, least in (
            ("--epochs", self.epochs, 1e-9),
            ("--seed", self.seed, 0),
            ("--workers", self.workers, 0),
            ("--learning-rate", self.learning_rate, 1e-9),
            ("--episodes", self.episodes, 1),
        ):
            if value is not None and value < least:
                raise TooFew(what, value, least)
        if self.model not in ("deformernet", "hu") and self.pairs != "all":
            raise UnusedOption(f"--pairs {self.pairs}", "--model deformernet or hu")
        if self.model != "hu" and not self.relu:
            raise UnusedOption("--no-relu", "--model hu")
        usual = ("light", "group", "scaled", True)
        if self.model == "hu" and (self.size, self.norm, self.coordinates, self.density) != usual:
            raise UnusedOption("--size, --norm, --coordinates or --no-density", "another --model")
        if self.minutes is not None and not self.minutes > 0:
            raise TooShort("--minutes", self.minutes)

    def _network(self, points: int) -> "Config":
        from dnet.errors import ShortCloud
        from dnet.nets.deformernet import DeformerNetConfig
        from dnet.nets.hu import HuNetConfig

        if self.points is not None and self.points > points:
            raise ShortCloud(points, self.points)
        if self.model == "hu":
            return HuNetConfig(points=self.points or points, relu=self.relu)
        return DeformerNetConfig(
            size=self.size,
            norm=self.norm,
            points=self.points or points,
            coordinates=self.coordinates,
            density=self.density,
        )

    def _settings(self, device: "torch.device") -> "TrainingSettings":
        import torch

        from dnet.training.tasks import TASKS

        gains = device.type == "cuda" and torch.cuda.is_bf16_supported()
        auto: Literal["float32", "bfloat16"] = "bfloat16" if gains else "float32"
        usual = TASKS[self.model].settings
        asked: dict[str, Any] = {
            "learning_rate": self.learning_rate,
            "groups": self.groups,
            "frames": self.frames,
            "rest_share": self.rest_share,
        }
        return replace(
            usual,
            epochs=self.epochs,
            schedule=self.schedule,
            seed=self.seed,
            pairs=self.pairs,
            augmentation=usual.augmentation if self.augment else None,
            precision=auto if self.precision == "auto" else self.precision,
            **{name: value for name, value in asked.items() if value is not None},
        )

    def _device(self, process: "Process") -> "torch.device":
        import torch

        from dnet.errors import NoDevice

        present = torch.cuda.is_available()
        if self.device == "cuda" and not present:
            raise NoDevice("cuda")
        if present and self.device != "cpu":
            return torch.device("cuda", process.local_rank)
        return torch.device("cpu")

    def _describe(
        self, division: "Division", config: "Config", settings: "TrainingSettings"
    ) -> dict[str, Any]:
        """Return what shaped the run, as config.json holds it."""
        parts = {
            "training": division.training,
            "unseen_shapes": division.unseen_shapes,
            "unseen_episodes": division.unseen_episodes,
        }
        begun = {
            "minutes": self.minutes,
            "weights": self._digest(),
            "episodes": self.episodes,
            # Runs from before there was a choice can be gone on with.
            "choose_by": None if self.choose_by == "unseen-episodes" else self.choose_by,
        }
        return {
            "network": {"model": self.model} | asdict(config),
            "training": asdict(settings) | begun,
            "data": {
                "directory": str(self.from_mcap),
                "validation": self.validation,
                "training": division.training.episodes_seen,
                "unseen_episodes": division.unseen_episodes.episodes_seen,
                "frames": {name: len(table) for name, table in parts.items()},
                "fingerprints": {name: table.fingerprint for name, table in parts.items()},
            },
            "versions": {name: version(name) for name in ("deformernet", "torch")},
        }

    def _begun_with(self) -> Path | None:
        """Return the file of the network to begin with; None for random weights."""
        from dnet.training.checkpoints import weights_file
        from dnet.weights import DEFORMERNET, HU

        usual = "random" if self.model in ("deformernet", "hu") else "shipped"
        match self.weights or usual:
            case "random":
                return None
            case "shipped":
                return HU if self.model == "hu" else DEFORMERNET
            case path:
                return weights_file(Path(path))

    def _digest(self) -> str | None:
        """Return what tells the weights to begin with from others; None for random ones."""
        import hashlib

        begun = self._begun_with()
        return None if begun is None else hashlib.sha256(begun.read_bytes()).hexdigest()[:16]

    def _begin(
        self,
        frames: "Frames",
        config: "Config",
        settings: "TrainingSettings",
        *,
        device: "torch.device",
        process: "Process",
    ) -> "Training":
        from dnet.training.checkpoints import begin_with
        from dnet.training.examples import stream_of
        from dnet.training.tasks import TASKS
        from dnet.training.training import Training

        task = TASKS[self.model]
        stream = stream_of(
            frames,
            settings,
            process=process,
            target=task.target,
            workers=self.workers,
            pin=device.type == "cuda",
        )
        model = task.new(config, seed=self.seed)
        begun = self._begun_with()
        if begun is not None:
            begin_with(model, begun)
        task.fit(model, frames)
        objective = task.objective(model.to(device))
        seconds = math.inf if self.minutes is None else 60 * self.minutes
        return Training(objective, stream, settings, process=process, seconds=seconds)

    def _fit(
        self,
        training: "Training",
        division: "Division",
        *,
        frames: "Frames",
        run: "RunWriter",
        console: "Console",
    ) -> None:
        from functools import partial

        from dnet.commands.stopping import stopping
        from dnet.commands.training_log import TrainingLog
        from dnet.commands.training_screen import TrainingBar
        from dnet.datasets.stream import dead_workers
        from dnet.training.division import thinned
        from dnet.training.frames import Frames
        from dnet.training.loop import HeldOut, fit

        samplings, config = frames.tables.samplings, frames.config
        watched = (
            Frames.of(thinned(table, WATCHED), config, samplings=samplings)
            for table in (division.unseen_shapes, division.unseen_episodes)
        )
        board = self.tensorboard and training.process.first
        say = partial(console.print, markup=False, highlight=False, soft_wrap=True)
        log = TrainingLog(run, board=board, say=say)
        with (
            dead_workers(),
            TrainingBar(console, epochs=self.epochs) as bar,
            stopping(training.stop),
            log,
        ):
            fit(
                training,
                HeldOut(*watched),
                run=run,
                on_event=bar.show,
                on_judged=log.add,
            )


def _prepared(division: "Division", config: "Config", console: "Console") -> "Frames":
    """Return the frames to learn from; find the tables of all frames, with a progress bar."""
    from dnet.commands.progress import progress
    from dnet.training.frames import Frames
    from dnet.training.neighbour_tables import samplings_for

    samplings = samplings_for(len(division.training))
    with progress(console, "clouds") as bar:
        task = bar.add_task("describing", total=len(division.all))
        tables = Frames.of(division.all, config, samplings=samplings).tables
        tables.build(on_clouds=lambda done: bar.advance(task, done))
    return Frames.of(division.training, config, samplings=samplings)
