"""`dnet servo`: drive the object to a goal shape, with a trained network or something else."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

if TYPE_CHECKING:
    from dnet.trials.request import Trial
    from dnet.types import Trace


Controller = Literal["deformernet", "hu", "hu-online", "oracle", "none", "rrt"]
Grasp = Literal["truth", "keypoints", "regressor", "dense", "displaced", "farthest"]


@dataclass(frozen=True)
class ServoOptions:
    """How a run goes and when it ends."""

    checkpoint: Path | None = None
    """Directory that `dnet train` wrote, one of its .safetensors files, or an .onnx of `dnet
    export`; the network that ships, unless given."""
    hu_checkpoint: Path | None = None
    """Network of `hu` and `hu-online`, likewise: what `dnet train --model hu` wrote; the one that
    ships, unless given."""
    grasp: Grasp = "truth"
    """What decides where the object is grasped: the point at which the goal was made; keypoints,
    where those are that move most; a network that answers with a position (`regressor`), or with
    a score for each point (`dense`); the point farthest from the goal (`displaced`), or from the
    truth, as bad as can be."""
    grasp_checkpoint: Path | None = None
    """Network that chooses the grasp; the one that ships, unless given."""
    steps: int = 12
    """Motions after which the run gives up: `out_of_steps`."""
    threshold: float = 0.002
    """The run has `converged` when the predicted motion is below this on every axis, in metres."""
    chamfer: float = 0.0
    """The goal is `reached` when the Chamfer distance to it is below this, in metres; 0: never."""
    patience: int | None = None
    """The run has `stalled` after so many motions that bring the object no nearer; 0: never. By
    default 5; never for random trials."""
    seconds: float = 0.0
    """Seconds of simulation after which the run is `out_of_time`; 0: never."""
    waypoints: int = 0
    """Of each plan, go so many checked positions, 1 mm apart, and look again; 0: all of it."""
    regrasp: int = 0
    """How often to let go and grasp the object elsewhere when the run stalls."""
    world: Literal["bullet", "quasistatic"] = "bullet"
    """`bullet`: dynamics in PyBullet; `quasistatic`: equilibria of the same energy, found many
    times as fast."""
    depth_noise: float = 0.0
    """Noise of the depth camera; 1 is that of a Kinect, 0 none."""
    dropped: float = 0.0
    """Share of the camera's images that are lost; three in a row, and the object is."""
    occlusion: bool = True
    """Whether the arms hide what is behind them from the camera."""
    seed: int = 0
    """Of everything drawn at random: planner, noise, random goals and trials."""

    def trial(self, goal: str, out: Path, *, controller: Controller) -> "Trial":
        """Return the run that these options ask for.

        Raises:
            DnetError: If an option is out of its range, or there is no such network.
        """
        from dnet.laboratory import LaboratorySettings
        from dnet.perception.noise import DepthNoise
        from dnet.servo.verdict import ServoSettings
        from dnet.trials.methods import points_of
        from dnet.trials.request import Trial

        self.check()
        of_hu = controller in ("hu", "hu-online")
        checkpoint = self.hu_checkpoint if of_hu else self.checkpoint
        patience = self.patience
        if patience is None:
            patience = 0 if controller == "rrt" else ServoSettings.patience
        return Trial(
            goal=goal,
            out=out,
            controller=controller,
            checkpoint=checkpoint,
            grasp=self.grasp,
            grasp_checkpoint=self.grasp_checkpoint,
            settings=ServoSettings(
                steps=self.steps,
                threshold=self.threshold,
                chamfer=self.chamfer,
                patience=patience,
                seconds=self.seconds,
                waypoints=self.waypoints,
                regrasps=self.regrasp,
            ),
            laboratory=LaboratorySettings(
                points=points_of(controller, checkpoint),
                world=self.world,
                noise=DepthNoise(scale=self.depth_noise) if self.depth_noise else None,
            ),
            occlusion=self.occlusion,
            dropped=self.dropped,
            seed=self.seed,
        )

    def check(self) -> None:
        """Raise if an option is out of its range."""
        from dnet.errors import NotAFraction, TooFew

        for what, value, least in (
            ("--steps", self.steps, 1),
            ("--threshold", self.threshold, 1e-6),
            ("--chamfer", self.chamfer, 0),
            ("--patience", self.patience or 0, 0),
            ("--seconds", self.seconds, 0),
            ("--waypoints", self.waypoints, 0),
            ("--regrasp", self.regrasp, 0),
            ("--depth-noise", self.depth_noise, 0),
            ("--seed", self.seed, 0),
        ):
            if not value >= least:
                raise TooFew(what, value, least)
        if not 0.0 <= self.dropped <= 1.0:
            raise NotAFraction("--dropped", self.dropped)


@dataclass(frozen=True)
class Servo:
    """Drive the object to a goal shape: observe, predict, plan, execute, again and again.

    The goal is a frame of a recorded episode, a cloud of your own, or drawn at random. The arm
    grasps the object, and each step plans a collision-free motion (straight line first,
    RRT-Connect around what blocks it). Everything is written to OUT/run.mcap, OUT/run.rrd and
    OUT/latency.jsonl; `dnet play OUT` shows the run, --view shows it live. However it ends, its
    outcome has a name, and the arms stay where they are and hold what they hold.

    Example: dnet servo --goal data/episode-0-00003.mcap:7 --out servo

    Example: dnet servo --goal random --seed 5 --controller oracle --world quasistatic --out servo

    Example: dnet servo --goals data --jobs 2 --out runs
    """

    out: Path
    """Directory for the run, or for one directory a run; made if need be."""
    goal: Annotated[str | None, tyro.conf.arg(metavar="EPISODE[:FRAME]|CLOUD|random[:SEED]")] = None
    """Episode file and the number of the frame to reach, by default its last; or a cloud (.npy,
    .ply, .pcd; metres, world frame); or `random`, a displacement drawn as `dnet record` does."""
    controller: Controller = "deformernet"
    """What decides the motions: a trained network; that of Hu et al., as it was trained or going on
    learning from what its motions do; the true displacement, known to the simulator alone; nothing,
    which never moves; random trials, of which those that help are kept."""
    goals: Annotated[Path | None, tyro.conf.arg(metavar="DIRECTORY")] = None
    """A run for each episode (its last frame) and each cloud in it. Called again, it goes on."""
    jobs: int = 1
    """Processes for the runs of `--goals`."""
    scene: Annotated[Path | None, tyro.conf.arg(metavar="EPISODE")] = None
    """For a cloud: set the object down as in this episode; unless given, as the seed draws it."""
    view: bool = False
    """Show the run in a window while it goes on; it is written to OUT all the same. Closing the
    window does not stop the run."""
    options: tyro.conf.OmitArgPrefixes[ServoOptions] = field(default_factory=ServoOptions)

    def run(self) -> None:
        """Run the loop, with a line for each step, and print how it ended.

        Raises:
            DnetError: If the checkpoint, the goal or the output directory will not do, or the
                grasp is out of reach.
        """
        from dnet.errors import OneOf, UnusedOption

        if (self.goal is None) == (self.goals is None):
            raise OneOf("--goal", "--goals")
        if self.view and self.goal is None:
            raise UnusedOption("--view", "--goal")
        if self.goals is None:
            self._run_one(str(self.goal))
        else:
            self._run_all(self.goals)

    def _run_one(self, goal: str) -> None:
        import threading
        from dataclasses import replace
        from functools import partial

        from rich.console import Console

        from dnet.commands.stopping import stopping
        from dnet.files.one_writer import one_writer
        from dnet.laboratory import laboratory
        from dnet.recorders.live_view import LiveView
        from dnet.trials.trial import run_trial

        self._check()
        trial = replace(
            self.options.trial(goal, self.out, controller=self.controller), scene=self.scene
        )
        say = partial(Console().print, highlight=False, markup=False, soft_wrap=True)
        asked = threading.Event()
        with one_writer(self.out), laboratory(trial.laboratory) as lab, stopping(asked.set):
            view = LiveView if self.view else None
            trace = run_trial(trial, lab, say=say, stop=asked.is_set, view=view)
        say(summary(trace))
        say(f"watch it with `dnet play {self.out}`")
        if trace.outcome == "interrupted":
            raise KeyboardInterrupt

    def _run_all(self, goals: Path) -> None:
        from dataclasses import replace

        from dnet.commands.servo_batch import run_batch
        from dnet.trials.batch import goals_in

        plain = self.options.trial("", self.out, controller=self.controller)
        trials = [
            replace(plain, goal=goal, out=self.out / name, scene=self.scene)
            for name, goal in goals_in(goals)
        ]
        run_batch(trials, jobs=self.jobs, out=self.out)

    def _check(self) -> None:
        from dnet.errors import OccupiedOutput

        if self.out.exists() and not self.out.is_dir():
            raise OccupiedOutput(self.out, "a file")
        held = sorted(self.out.glob("run.*"))
        if held:
            raise OccupiedOutput(self.out, f"a run ({held[0].name})")


def summary(trace: "Trace") -> str:
    """Return one line on how a run went."""
    motions = sum(step.plan is not None for step in trace.steps)
    text = f"{trace.outcome} after {motions} motions"
    if trace.reason:
        text += f" ({trace.reason})"
    if trace.steps:
        first, last = trace.steps[0].chamfer, trace.steps[-1].chamfer
        text += f": Chamfer {first * 1e3:.2f} mm -> {last * 1e3:.2f} mm"
    return text
