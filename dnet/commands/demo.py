"""`dnet demo`: the whole chain on a small scale, each step with the command that does it."""

import os
from dataclasses import asdict, dataclass
from pathlib import Path

from dnet.commands.inspect import Info, Inspect, List
from dnet.commands.play import Play
from dnet.commands.record import Record
from dnet.commands.servo import Servo, ServoOptions
from dnet.commands.train import Train


@dataclass(frozen=True)
class Demo:
    """Record, train, servo and play on a small scale, and show the command behind each step.

    The goal of the servo run is a shape of an episode that the network was not trained on. A
    table at the end says what came out; the files stay for `dnet play` and `dnet inspect`. Called
    again, it goes on after the last step that was finished.

    Example: dnet demo --out demo
    """

    out: Path = Path("demo")
    """Directory for everything; made if need be."""
    pairs: int = 12
    """Episodes to record."""
    shapes: int = 20
    """Shapes an episode."""
    epochs: int = 70
    """To train, two or three minutes of two idle cores."""
    seed: int = 0
    """Of everything drawn at random."""

    def run(self) -> None:
        """Run the chain.

        Raises:
            OccupiedOutput: If the directory holds a demo with other options.
            DnetError: If a step fails.
        """
        from rich.console import Console

        from dnet.commands.demo_summary import held_out_goal, summary
        from dnet.commands.stages import Stages
        from dnet.trials.trial import clear

        console = Console()
        options = {**asdict(self), "out": str(self.out)}
        steps = Stages(self.out / "demo.json", options, console)
        workers = min(os.cpu_count() or 1, self.pairs)
        data, train, servo = self.out / "data", self.out / "train", self.out / "servo"
        steps.run(
            "record",
            f"dnet record {data} --pairs {self.pairs} --shapes {self.shapes} --seed {self.seed} "
            f"--workers {workers}",
            Record(data, pairs=self.pairs, shapes=self.shapes, seed=self.seed, workers=workers),
        )
        steps.run("list", f"dnet inspect ls {data}", Inspect(List(data)))
        steps.run(
            "train",
            f"dnet train --from-mcap {data} --out {train} --epochs {self.epochs} "
            f"--seed {self.seed} --resume",
            Train(data, train, epochs=self.epochs, seed=self.seed, resume=True),
        )
        goal, frame = held_out_goal(data, train)
        if "servo" not in steps.seconds:
            clear(servo)  # of a run that was stopped: a run is never written over
        steps.run(
            "servo",
            f"dnet servo --checkpoint {train} --goal {goal}:{frame} --out {servo}",
            Servo(servo, goal=f"{goal}:{frame}", options=ServoOptions(checkpoint=train)),
        )
        run = servo / "run.mcap"
        steps.run("describe", f"dnet inspect info {run}", Inspect(Info(run)))
        for name, source, picture in (
            ("picture of the run", servo / "run.rrd", self.out / "servo.png"),
            ("picture of the goal", goal, self.out / "episode.png"),
        ):
            steps.run(
                name,
                f"dnet play {source} --screenshot {picture}",
                Play((source,), screenshot=picture),
            )
        console.print(summary(self.out, steps.seconds))
