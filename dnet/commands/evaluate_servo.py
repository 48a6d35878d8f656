"""`dnet evaluate servo`: many goals, several controllers, one table, all of it from the logs."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from dnet.commands.servo import Controller, Grasp, ServoOptions

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dnet.evaluation.servo_scores import Score
    from dnet.trials.request import Trial


@dataclass(frozen=True)
class ServoGoals:
    """Servo to many unseen goals with several controllers, and compare how near they come.

    Goals are settled shapes of episodes, drawn at random, or made anew from seeds. Every run
    counts, however it ended. OUT/servo.md is the table, OUT/servo.csv and OUT/servo.json hold the
    figures; all come from the runs' logs in OUT/CONTROLLER/GOAL. Stopped, the same call goes on.

    Example: dnet evaluate servo --from-mcap data/held-out --goals 100 --jobs 2 --out eval

    Example: dnet evaluate servo --goals 20 --controllers deformernet rrt --out eval
    """

    out: Path
    """Directory for the runs and the table."""
    goals: int = 100
    """How many goals."""
    from_mcap: Annotated[Path | None, tyro.conf.arg(metavar="DIRECTORY")] = None
    """Episodes to take goals from; without, each is made from a seed."""
    episode: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(metavar="ID")] = ()
    """Of the directory, these episodes alone, such as those held out: ids; with commas or
    repeated."""
    controllers: tuple[Controller, ...] = ("none", "deformernet", "oracle")
    """What to compare."""
    grasps: tuple[Grasp, ...] = ()
    """Ways to choose the grasp, each with every controller; the one that --grasp names, unless
    given."""
    jobs: int = 1
    """Processes."""
    first_seed: int = 1_000_000
    """Of goals that are made: those of `random:SEED`, counted up from here."""
    rrd: tyro.conf.FlagCreatePairsOff[bool] = False
    """Write run.rrd, too: `dnet play` shows run.mcap as well."""
    options: tyro.conf.OmitArgPrefixes[ServoOptions] = field(
        default_factory=lambda: ServoOptions(world="quasistatic")
    )

    def run(self) -> None:
        """Carry out what is not there yet, with a progress bar, and print the table.

        Raises:
            DnetError: If the episodes, the network or the directory will not do.
        """
        from dnet.commands.servo_batch import finish
        from dnet.errors import TooFew

        if self.goals < 1:
            raise TooFew("--goals", self.goals, 1)
        goals = self._goals()
        methods = self._methods()
        trials = [trial for method in methods for trial in self._trials(*method, goals)]
        scores = finish(trials, jobs=self.jobs, what="evaluating")
        found = [
            (self._name(*method), scores[number * len(goals) : (number + 1) * len(goals)])
            for number, method in enumerate(methods)
        ]
        # As it is written: a terminal of 80 columns has no room for it in a frame.
        print(self._write(found), end="")

    def _goals(self) -> list[str]:
        """Return the goals, each as `dnet servo --goal` takes it."""
        if self.from_mcap is None:
            return [f"random:{self.first_seed + number}" for number in range(self.goals)]
        from dnet.evaluation.servo_goals import draw_goals

        wanted = [one.strip() for some in self.episode for one in some.split(",") if one.strip()]
        return draw_goals(self.from_mcap, wanted, count=self.goals, seed=self.options.seed)

    def _methods(self) -> list[tuple[Controller, Grasp]]:
        grasps = self.grasps or (self.options.grasp,)
        return [(controller, grasp) for controller in self.controllers for grasp in grasps]

    def _name(self, controller: Controller, grasp: Grasp) -> str:
        """Return what a method is called in the table, and its folder."""
        return controller if grasp == "truth" else f"{controller}-{grasp}"

    def _trials(self, controller: Controller, grasp: Grasp, goals: list[str]) -> "list[Trial]":
        from dataclasses import replace

        plain = replace(self.options.trial("", self.out, controller=controller), grasp=grasp)
        folder = self.out / self._name(controller, grasp)
        trials = [replace(plain, goal=goal, recording=self.rrd) for goal in goals]
        return [replace(one, out=folder / one.goal_name) for one in trials]

    def _write(self, found: "Sequence[tuple[str, list[Score]]]") -> str:
        import json

        from dnet.evaluation.servo_table import servo_frame, servo_table, summary
        from dnet.files.whole_file import write_whole

        table = servo_table(found)
        figures = {name: summary(scores) for name, scores in found}
        for name, content in (
            ("servo.md", table),
            ("servo.csv", servo_frame(found).write_csv()),
            ("servo.json", json.dumps(figures, indent=2)),
        ):
            write_whole(self.out / name, content.encode())
        return table
