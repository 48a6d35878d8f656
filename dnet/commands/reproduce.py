"""`dnet reproduce`: the paper from nothing, on any scale."""

import os
import shlex
from dataclasses import dataclass
from pathlib import Path

import tyro

from dnet.commands.evaluate import Evaluate
from dnet.commands.record import Record
from dnet.commands.stages import Command
from dnet.commands.train import Train
from dnet.files.whole_file import write_whole

ENTRIES: dict[str, type[Command]] = {"record": Record, "train": Train, "evaluate": Evaluate}


@dataclass(frozen=True)
class Reproduce:
    """Record, train every network, evaluate and report: the paper from nothing, on any scale.

    Scale 1 is the paper's: 150 episodes of 200 shapes, the trainings of the networks that ship,
    100 cases of grasping and 100 goals to servo to. Less of it takes proportionally less time,
    but for what starting takes. The data are those of the quasi-static world. The cases and goals
    are of episodes of their own, which nothing learns from.

    OUT/report/report.html tells every figure of the paper beside ours, all with the networks that
    were trained (pip install "deformernet[report]").

    The command of each stage is shown, and can be run by hand. Stopped or killed, the same call
    goes on: with the stage under way where that can be gone on with, and with the next one
    otherwise. OUT/times.md tells how long each stage took.

    Example: dnet reproduce --scale 0.02 --out reproduction
    """

    scale: float = 0.02
    """Share of the paper's work."""
    out: Path = Path("reproduction")
    """Directory for everything; made if need be."""
    seed: int = 0
    """Of everything drawn at random."""
    workers: int = os.cpu_count() or 1
    """Processes to record and to servo on."""

    def run(self) -> None:
        """Go through the stages.

        Raises:
            TooFew: If the scale is not above 0, or another number too small.
            OccupiedOutput: If the directory holds a reproduction with other options.
            DnetError: If a stage fails.
            KeyboardInterrupt: If one was stopped.
        """
        from rich.console import Console

        from dnet.commands.reproduction import plan
        from dnet.commands.stages import Stages

        self._check()
        console = Console()
        options = {"scale": self.scale, "out": str(self.out), "seed": self.seed}
        stages = Stages(self.out / "reproduction.json", options, console)
        for stage in plan(self.out, self.scale, seed=self.seed, workers=self.workers):
            stages.run(stage.name, stage.line, command_of(stage.line))
            _write_times(self.out / "times.md", stages.seconds)
        console.print(f"\n{(self.out / 'times.md').read_text(encoding='utf-8')}", highlight=False)

    def _check(self) -> None:
        from dnet.errors import TooFew

        for what, value, least in (
            ("--scale", self.scale, 1e-9),
            ("--seed", self.seed, 0),
            ("--workers", self.workers, 1),
        ):
            if value < least:
                raise TooFew(what, value, least)


def command_of(line: str) -> Command:
    """Return what a command line of `dnet` stands for."""
    _, entry, *arguments = shlex.split(line)
    return tyro.cli(ENTRIES[entry], args=arguments)


def _write_times(file: Path, seconds: dict[str, float]) -> None:
    """Write how long the stages took that are done."""
    rows = [*seconds.items(), ("together", sum(seconds.values()))]
    table = "".join(f"| {name} | {taken:.1f} |\n" for name, taken in rows)
    write_whole(file, f"| stage | seconds |\n|---|--:|\n{table}".encode())
