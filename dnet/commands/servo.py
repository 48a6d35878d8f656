"""`dnet servo`: drive the object to a goal shape with a trained network."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

if TYPE_CHECKING:
    from collections.abc import Iterator

    from dnet.laboratory import Laboratory
    from dnet.types import EpisodeMeta, FrameKind, Goal, Scene, Trace


@dataclass(frozen=True)
class Servo:
    """Drive the object to a goal shape: observe, predict, plan, execute, again and again.

    The goal is a frame of a recorded episode; the run starts from that episode's initial
    configuration and grasps its true manipulation point. Each step plans a collision-free
    motion (straight line first, RRT-Connect around what blocks it) and is written to OUT/run.mcap
    and OUT/run.rrd: `dnet play OUT/run.rrd` shows the run.

    Example: dnet servo --goal data/episode-0-00003.mcap:7 --out servo
    """

    goal: Annotated[str, tyro.conf.arg(metavar="EPISODE[:FRAME]")]
    """Episode file and the number of the frame to reach; without a number, its last frame.
    `dnet inspect info EPISODE` lists the frames."""
    out: Path
    """Directory for the run; made if need be, must hold none yet."""
    checkpoint: Path | None = None
    """Directory that `dnet train` wrote, or one of its .safetensors files; the network that
    ships, unless given."""
    steps: int = 12
    """Motions after which the run gives up."""
    threshold: float = 0.002
    """The goal counts as reached when the predicted motion is below this on every axis, in
    metres."""
    seed: int = 0
    """Of the planner."""

    def run(self) -> None:
        """Run the loop, with a line for each step, and print how it ended.

        Raises:
            DnetError: If the checkpoint, the goal or the output directory will not do, or the
                grasp is out of reach.
        """
        from rich.console import Console

        import dnet
        from dnet.commands.servo_log import RECORDING, ServoLog
        from dnet.laboratory import LaboratorySettings, laboratory
        from dnet.servo.loop import ServoSettings, servo
        from dnet.sim.observe import observe

        self._check()
        model = dnet.load(self.checkpoint)
        goal, scene = self._read_goal(model.config.points)
        console = Console()
        with laboratory(LaboratorySettings(points=model.config.points)) as lab:
            lab.world.reset(scene)
            lab.world.settle()
            kinds = _kinds()
            with ServoLog(self.out, self._meta(lab, goal, scene), lab, console) as log:
                log.start(goal)
                trace = servo(
                    lab.world,
                    lambda: observe(lab.world, lab.see, next(kinds)),
                    model,
                    lab.planner,
                    goal,
                    settings=ServoSettings(steps=self.steps, threshold=self.threshold),
                    seed=self.seed,
                    watch=log.add,
                )
                log.finish(trace)
        if trace.steps:
            console.print(_summary(trace), highlight=False)
        console.print(f"watch it with `dnet play {self.out / RECORDING}`", highlight=False)

    def _check(self) -> None:
        from dnet.errors import OccupiedOutput, TooFew

        for what, value, least in (("--steps", self.steps, 1), ("--seed", self.seed, 0)):
            if value < least:
                raise TooFew(what, value, least)
        if self.threshold <= 0:
            raise TooFew("--threshold", self.threshold, 1e-6)
        if self.out.exists() and not self.out.is_dir():
            raise OccupiedOutput(self.out, "a file")
        held = sorted(self.out.glob("run.*"))
        if held:
            raise OccupiedOutput(self.out, f"a run ({held[0].name})")

    def _read_goal(self, points: int) -> "tuple[Goal, Scene]":
        from dnet.datasets.reader import EpisodeReader
        from dnet.errors import BadCheckpoint
        from dnet.types import Goal
        from dnet.weights import DEFORMERNET

        path, number = split_goal(self.goal)
        with EpisodeReader(path) as episode:
            frame = episode.frame(len(episode) - 1 if number is None else number)
            if len(frame.cloud) != points:
                raise BadCheckpoint(
                    self.checkpoint or DEFORMERNET,
                    f"takes clouds of {points} points, the goal has {len(frame.cloud)}",
                    "use a network trained on clouds like the goal's",
                )
            source = f"{path.name}:{len(episode) - 1 if number is None else number}"
            return Goal(frame.cloud.copy(), source), episode.meta.scene

    def _meta(self, lab: "Laboratory", goal: "Goal", scene: "Scene") -> "EpisodeMeta":
        import dnet
        from dnet.types import EpisodeMeta

        name = f"servo-{goal.source.replace('.mcap:', '-')}"
        checkpoint = self.checkpoint.name if self.checkpoint else f"dnet {dnet.__version__}"
        run = {"goal": goal.source, "checkpoint": checkpoint}
        settings = lab.settings.describe() | run
        return EpisodeMeta(name, self.seed, 0, scene, settings)


def _kinds() -> "Iterator[FrameKind]":
    """Yield what each frame of a run is: it starts from rest."""
    yield "rest"
    while True:
        yield "shape"


def _summary(trace: "Trace") -> str:
    motions = sum(step.plan is not None for step in trace.steps)
    first, last = trace.steps[0].chamfer, trace.steps[-1].chamfer
    return (
        f"{trace.outcome} after {motions} motions: "
        f"Chamfer {first * 1e3:.2f} mm -> {last * 1e3:.2f} mm"
    )


def split_goal(goal: str) -> tuple[Path, int | None]:
    """Return the episode and the frame of `EPISODE[:FRAME]`; None for no frame."""
    match = re.fullmatch(r"(.+):(\d+)", goal)
    if match and not Path(goal).exists():
        return Path(match[1]), int(match[2])
    return Path(goal), None
