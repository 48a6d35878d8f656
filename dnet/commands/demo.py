"""`dnet demo`: the whole chain on a small scale, each step with the command that does it."""

import shlex
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from dnet.commands.inspect import Info, Inspect, List
from dnet.commands.play import Play
from dnet.commands.record import Record
from dnet.commands.servo import Servo
from dnet.commands.train import Train

if TYPE_CHECKING:
    from rich.console import Console

    Command = Record | Train | Servo | Play | Inspect


@dataclass(frozen=True)
class Demo:
    """Record, train, servo and play on a small scale, and show the command behind each step.

    The goal of the servo run is a shape of an episode that the network was not trained on. A
    table at the end says what came out; the files stay for `dnet play` and `dnet inspect`.

    Example: dnet demo --out demo
    """

    out: Path = Path("demo")
    """Directory for everything; made if need be, must hold no demo yet."""
    pairs: int = 5
    """Episodes to record."""
    shapes: int = 20
    """Shapes an episode."""
    minutes: float = 2.0
    """Time to train."""
    seed: int = 0
    """Of everything drawn at random."""

    def run(self) -> None:
        """Run the chain.

        Raises:
            OccupiedOutput: If the directory holds a demo already.
            DnetError: If a step fails.
        """
        from rich.console import Console  # noqa: PLC0415

        from dnet.commands.demo_summary import held_out_goal, summary  # noqa: PLC0415
        from dnet.errors import OccupiedOutput  # noqa: PLC0415

        data, run, servo = self.out / "data", self.out / "train", self.out / "servo"
        for held in (data, run, servo):
            if held.exists():
                raise OccupiedOutput(self.out, f"a demo ({held.name}/)")
        console = Console(stderr=True)
        seconds: dict[str, float] = {}

        def step(name: str, line: str, command: "Command") -> None:
            seconds[name] = _timed(console, line, command.run)

        step(
            "record",
            f"dnet record {data} --pairs {self.pairs} --shapes {self.shapes} --seed {self.seed}",
            Record(data, pairs=self.pairs, shapes=self.shapes, seed=self.seed),
        )
        step("inspect", f"dnet inspect ls {data}", Inspect(List(data)))
        step(
            "train",
            f"dnet train --from-mcap {data} --out {run} --minutes {self.minutes} "
            f"--seed {self.seed}",
            Train(data, run, minutes=self.minutes, seed=self.seed),
        )
        goal = held_out_goal(data, run)
        step(
            "servo",
            f"dnet servo --checkpoint {run} --goal {goal} --out {servo}",
            Servo(run, goal, servo),
        )
        step("look", f"dnet inspect info {servo / 'run.mcap'}", Inspect(Info(servo / "run.mcap")))
        for source, picture in (
            (servo / "run.rrd", self.out / "servo.png"),
            (Path(goal.rsplit(":", 1)[0]), self.out / "episode.png"),
        ):
            step(
                f"picture of {source.name}",
                f"dnet play {source} --screenshot {picture}",
                Play((source,), screenshot=picture),
            )
        console.print(summary(self.out, goal, seconds))


def _timed(console: "Console", line: str, run: Callable[[], None]) -> float:
    """Show a command, run it, and return how many seconds it took."""
    console.print(f"\n[bold]$ {shlex.join(line.split())}[/bold]", highlight=False, soft_wrap=True)
    start = perf_counter()
    run()
    return perf_counter() - start
