"""`dnet evaluate paper`: the paper, reproduced, and every figure of it beside ours."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

if TYPE_CHECKING:
    from rich.console import Console

    from dnet.commands.paper.request import PaperRequest
    from dnet.evaluation.report.values import Report

Name = Literal["grasp", "cases", "importance", "networks", "goals", "generalisation"]


@dataclass(frozen=True)
class Paper:
    """Run the experiments of the paper, and write a report of them.

    OUT gets a directory an experiment, with a log of every run, and report.html, one file that
    needs no network; the same figures as report.md, report.csv and tables/*.csv. What is there
    already is not run again: stopped, the same call goes on. `dnet evaluate --list` tells what
    the experiments are, need and cost.

    Example: dnet evaluate paper --out report --scale 0.02

    Example: dnet evaluate paper --out report --from-mcap data/paper --runs runs --jobs 2

    Example: dnet evaluate paper --out report --from-logs
    """

    out: Path
    """Directory of the report."""
    only: tyro.conf.UseAppendAction[tuple[Name, ...]] = ()
    """Run these alone; repeated. What is there of the others is reported all the same."""
    scale: float = 1.0
    """Share of the cases and goals to do, one at least: 0.02 shows the whole chain in minutes."""
    from_mcap: Annotated[Path | None, tyro.conf.arg(metavar="DIRECTORY")] = None
    """Episodes to take cases and goals from; unless given, 25 are recorded into OUT/data."""
    validation: float = 0.1
    """Share of --from-mcap that the networks were not trained on, found by hashes as `dnet train`
    does; 1 for all of them, where the networks are of other data. (Those that ship: 0.1.)"""
    runs: Annotated[Path | None, tyro.conf.arg(metavar="DIRECTORY")] = None
    """Trainings of `dnet train`, each in a directory of its own: their errors are compared."""
    checkpoint: Path | None = None
    """DeformerNet to judge and to drive with; the one that ships, unless given."""
    keypoints: Path | None = None
    """Run of `dnet train --model keypoints`; the network that ships, unless given."""
    regressor: Path | None = None
    """Run of `dnet train --model grasp`; the network that ships, unless given."""
    dense: Path | None = None
    """Run of `dnet train --model dense`; the network that ships, unless given."""
    world: Literal["bullet", "quasistatic"] = "bullet"
    """Where the servo cases happen: in PyBullet, or in equilibria of the same energy, faster. All
    else is in the quasi-static world, of which the networks that ship are."""
    jobs: int = 1
    """Processes."""
    seed: int = 0
    """Of the division into seen and unseen episodes, of which shapes are taken, and of runs."""
    from_logs: tyro.conf.FlagCreatePairsOff[bool] = False
    """Run nothing: report what is in OUT."""

    def run(self) -> None:
        """Carry out what is not there yet, with progress bars, and write the report.

        Raises:
            DnetError: If an option, the episodes or a training will not do, or plotly or jinja2
                is missing.
            KeyboardInterrupt: After Ctrl-C: what was finished is kept.
        """
        from rich.console import Console

        from dnet.evaluation.report.page import require_report
        from dnet.evaluation.report.reading import read_report
        from dnet.evaluation.report.writing import write_report

        self._check()
        require_report()
        console = Console(stderr=True)
        if not self.from_logs:
            self._carry_out(console)
        with console.status("reading the logs") as status:
            report = read_report(
                self.out, on_section=lambda name: status.update(f"reading the logs: {name}")
            )
            status.update("drawing")
            write_report(report, self.out)
        self._say(report)

    def _carry_out(self, console: "Console") -> None:
        from dnet.commands.paper.experiments import RUN

        request = self._request(console)
        for name, run in RUN.items():
            if not self.only or name in self.only:
                console.print(f"[bold]{name}[/bold]", highlight=False)
                run(request)

    def _request(self, console: "Console") -> "PaperRequest":
        from dnet.commands.paper.request import PaperRequest

        grasps = {"keypoints": self.keypoints, "regressor": self.regressor, "dense": self.dense}
        return PaperRequest(
            out=self.out,
            from_mcap=self.from_mcap,
            validation=self.validation,
            runs=self.runs,
            checkpoint=self.checkpoint,
            grasps={name: path for name, path in grasps.items() if path is not None},
            world=self.world,
            scale=self.scale,
            jobs=self.jobs,
            seed=self.seed,
            console=console,
        )

    def _check(self) -> None:
        from dnet.errors import MissingPath, NotAFraction, TooFew

        if not 0 < self.scale <= 1:
            raise NotAFraction("--scale", self.scale)
        if not 0 <= self.validation <= 1:
            raise NotAFraction("--validation", self.validation)
        for what, value, least in (("--jobs", self.jobs, 1), ("--seed", self.seed, 0)):
            if value < least:
                raise TooFew(what, value, least)
        if self.runs is not None and not self.runs.is_dir():
            raise MissingPath(self.runs, "directory", "give one with trainings of `dnet train`")
        if self.from_logs and not self.out.is_dir():
            raise MissingPath(self.out, "report", "run it without --from-logs")

    def _say(self, report: "Report") -> None:
        from dnet.evaluation.report.writing import PAGE

        for claim in report.claims:
            ours = f"{claim.ours} (paper: {claim.paper})" if claim.ours else claim.reason
            print(f"{claim.verdict:13} {claim.where}: {claim.what}: {ours}")
        print(self.out / PAGE)


def list_experiments() -> None:
    """Print what the experiments of the report are, need and cost."""
    from rich.console import Console
    from rich.table import Table

    from dnet.evaluation.report.catalogue import EXPERIMENTS

    table = Table("name", "reproduces", "needs", "costs (one core)", show_lines=True)
    for name, one in EXPERIMENTS.items():
        table.add_row(name, one.reproduces, one.needs, one.cost)
    console = Console()
    console.print(table)
    console.print(
        "dnet evaluate paper --out REPORT [--only NAME] [--scale 0.02]",
        highlight=False,
        markup=False,
    )
