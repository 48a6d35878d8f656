"""`dnet train`: learn from recorded episodes how far the grasp must move."""

import math
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    import torch
    from rich.console import Console

    from dnet.nets.deformernet import DeformerNet, DeformerNetConfig
    from dnet.training.episodes import Division
    from dnet.training.frames import Frames
    from dnet.training.loop import Result, TrainingSettings
    from dnet.training.run import RunWriter
    from dnet.types import Place


@dataclass(frozen=True)
class Train:
    """Train DeformerNet on episodes and keep the network that judges unseen ones best.

    Every settled frame of an episode is paired with every other: the network sees both clouds
    and learns the motion of the grasp between them. Some episodes are held out to judge it by.
    The run directory gets config.json, best.safetensors, last.safetensors and metrics.jsonl, a
    line an epoch. Ctrl-C stops after the last whole epoch and keeps what was learned.

    Example: dnet train --from-mcap data/small --out runs/small --epochs 200
    """

    from_mcap: Path
    """Directory with episodes of `dnet record`; two or more."""
    out: Path
    """Directory for the run; made if need be, must hold none yet."""
    epochs: int = 200
    """How often every frame is seen (paper: 100, of 30,000 frames)."""
    minutes: float | None = None
    """Stop in this time even so. The schedule then follows the clock, and a second training on
    the same data ends in slightly different weights."""
    size: Literal["light", "paper"] = "light"
    """Levels of the encoder; `paper` takes seven times as long."""
    norm: Literal["group", "batch"] = "group"
    """Normalisation; `batch` is what the paper states."""
    schedule: Literal["cosine", "step"] = "cosine"
    """Of the learning rate: `cosine` to zero, or a `step` of 1/10 every 50 epochs (paper)."""
    augment: bool = True
    """Turn and shift each group of frames about the table at random."""
    validation: float = 0.25
    """Share of the episodes to hold out; at least one is."""
    seed: int = 0
    """Of the division, the first weights, the order and the augmentation."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """Where to train; `auto` takes a GPU if there is one."""

    def run(self) -> None:
        """Train, with a progress bar, and print the errors.

        Raises:
            DnetError: If the episodes, the output directory or an option will not do.
        """
        from rich.console import Console

        from dnet.commands.index_bar import read_index
        from dnet.commands.training_screen import error_table, show_data
        from dnet.nets.deformernet import DeformerNetConfig
        from dnet.training.allocation import keep_pages
        from dnet.training.episodes import divide
        from dnet.training.loop import new_network
        from dnet.training.run import RunWriter
        from dnet.training.scores import errors_of

        self._check()
        settings, device, console = self._settings(), self._device(), Console(stderr=True)
        index = read_index(self.from_mcap, console)
        division = divide(index, fraction=self.validation, seed=self.seed)
        config = DeformerNetConfig(size=self.size, norm=self.norm, points=division.points)
        writer = RunWriter(self.out, self._describe(division, config, settings))
        keep_pages()
        training, validation = _read(
            division, config, root=index.root, seed=self.seed, console=console
        )
        model = new_network(config, seed=self.seed).to(device)
        show_data(console, division, training)
        result = self._fit(
            model,
            training,
            validation=validation,
            settings=settings,
            writer=writer,
            console=console,
        )
        writer.finish(result, config)
        model.load_state_dict(result.best)
        errors = {
            "training": errors_of(model, training),
            "validation": errors_of(model, validation),
        }
        Console().print(error_table(errors))
        console.print(_closing_line(result, self.out))

    def _check(self) -> None:
        from dnet.errors import TooFew, TooShort

        for what, value, least in (("--epochs", self.epochs, 1), ("--seed", self.seed, 0)):
            if value < least:
                raise TooFew(what, value, least)
        if self.minutes is not None and not self.minutes > 0:
            raise TooShort("--minutes", self.minutes)

    def _settings(self) -> "TrainingSettings":
        from dnet.training.augment import Augmentation
        from dnet.training.loop import TrainingSettings

        return TrainingSettings(
            epochs=self.epochs,
            schedule=self.schedule,
            seed=self.seed,
            augmentation=Augmentation() if self.augment else None,
        )

    def _device(self) -> "torch.device":
        import torch

        from dnet.errors import NoDevice

        present = torch.cuda.is_available()
        if self.device == "cuda" and not present:
            raise NoDevice("cuda")
        return torch.device("cuda" if present and self.device != "cpu" else "cpu")

    def _describe(
        self, division: "Division", config: "DeformerNetConfig", settings: "TrainingSettings"
    ) -> dict[str, Any]:
        """Return what shaped the run, as config.json holds it."""
        from dnet.training.frames import samplings_for

        samplings = samplings_for(sum(survey.frames for survey in division.training))
        return {
            "network": asdict(config),
            "training": asdict(settings) | {"minutes": self.minutes, "samplings": samplings},
            "data": {
                "directory": str(self.from_mcap),
                "training": [survey.episode_id for survey in division.training],
                "validation": [survey.episode_id for survey in division.validation],
            },
            "versions": {name: version(name) for name in ("deformernet", "torch")},
        }

    def _fit(
        self,
        model: "DeformerNet",
        training: "Frames",
        *,
        validation: "Frames",
        settings: "TrainingSettings",
        writer: "RunWriter",
        console: "Console",
    ) -> "Result":
        from dnet.commands.training_screen import TrainingBar
        from dnet.training.loop import EpochDone, StepDone, fit

        with TrainingBar(console, epochs=self.epochs) as bar:

            def on_event(event: StepDone | EpochDone) -> None:
                bar.show(event)
                if isinstance(event, EpochDone):
                    writer.add(event, model)

            return fit(
                model,
                training,
                validation=validation,
                settings=settings,
                on_event=on_event,
                seconds=math.inf if self.minutes is None else 60 * self.minutes,
            )


def _read(
    division: "Division",
    config: "DeformerNetConfig",
    *,
    root: "Place",
    seed: int,
    console: "Console",
) -> "tuple[Frames, Frames]":
    """Return the training and the validation frames, with a progress bar."""
    from dnet.commands.progress import progress
    from dnet.training.episodes import open_each
    from dnet.training.frames import read_frames, samplings_for
    from dnet.training.neighbour_tables import KeptNeighbourhoods

    surveys = (*division.training, *division.validation)
    find = KeptNeighbourhoods(root, {survey.path: survey.digest for survey in surveys})
    learned, judged = (
        sum(survey.frames for survey in part) for part in (division.training, division.validation)
    )
    with progress(console, "clouds") as bar:
        task = bar.add_task("finding neighbours", total=learned + judged)

        def advance() -> None:
            bar.advance(task)

        training = read_frames(
            open_each(division.training),
            config,
            samplings=samplings_for(learned),
            seed=seed,
            find=find,
            on_cloud=advance,
        )
        judged_by = open_each(division.validation)
        return training, read_frames(judged_by, config, find=find, on_cloud=advance)


def _closing_line(result: "Result", out: Path) -> str:
    best = min(result.history, key=lambda done: done.validation.any_pair.mse_mm2)
    seconds = result.history[-1].seconds
    ended = "interrupted; " if result.interrupted else ""
    return (
        f"{ended}{len(result.history)} epochs in {seconds:.0f} s, the best was epoch "
        f"{best.epoch}; wrote {out}"
    )
