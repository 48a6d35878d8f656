"""One servo run from its request to its files."""

import json
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

import dnet
from dnet.datasets.reader import EpisodeReader
from dnet.errors import DnetError, NoGrasp, OtherRun, ShortCloud
from dnet.files.whole_file import write_whole
from dnet.laboratory import Laboratory
from dnet.recorders.run_sinks import OpenView
from dnet.servo.controllers import Controller
from dnet.servo.grasping import Hand
from dnet.servo.held_end import LIMIT, held_end_apart
from dnet.servo.loop import Surroundings, servo
from dnet.servo.pickers import Choice, Picker, candidates
from dnet.servo.sparing import SparingPlanner
from dnet.sim.grasp import at
from dnet.trials.eyes import Eyes
from dnet.trials.goals import Task, read_task
from dnet.trials.log import Free, Say, TrialLog, free_bytes, pose_of
from dnet.trials.methods import CONTROLLERS, PICKERS, Setting
from dnet.trials.request import LATENCY, LEARNED, RECORDING, REFUSED, RUN, Trial
from dnet.types import Cloud, EpisodeMeta, Point, Trace


def run_trial(
    trial: Trial,
    lab: Laboratory,
    *,
    say: Say,
    stop: Callable[[], bool] = bool,
    controller: Controller | None = None,
    view: OpenView | None = None,
    free: Free = free_bytes,
) -> Trace:
    """Carry a trial out and return what happened; its files tell the same.

    Args:
        trial: What is asked.
        lab: The laboratory that it asks for.
        say: Shows a line to people.
        stop: Whether somebody wants the run to end.
        controller: Decides instead of the one that the trial names.
        view: Opens a window that shows the run while it goes on; None for none.
        free: Says how much room a folder has.

    Raises:
        DnetError: If there is no such goal or network, or the object cannot be grasped.
    """
    task = read_task(trial, lab)
    setting = Setting(trial, task, lab)
    controller = controller or CONTROLLERS[trial.controller](setting)
    picker = PICKERS[trial.grasp](setting)
    with closing(Eyes(lab, task.scene, trial)) as eyes:
        grasping = _Grasping(trial, task, lab, eyes, picker)
        point = grasping.begin()
        with TrialLog(
            trial.out,
            _meta(trial, task, lab, point),
            lab,
            say=say,
            recording=trial.recording,
            view=view,
            free=free,
        ) as log:
            log.start(task.goal, grasping.hand.motions)
            grasping.tell = log
            grasping.tell_choice()
            if grasping.apart > LIMIT:
                log.warn(_another_object(grasping.apart), time=lab.world.time)
            trace = servo(
                Surroundings(
                    lab.world,
                    eyes.look,
                    controller,
                    SparingPlanner(lab.planner, lab.world.borne),
                    log,
                    regrasp=grasping.again,
                    stop=stop,
                ),
                task.goal,
                settings=trial.settings,
                seed=trial.seed,
            )
            log.finish(trace, _result(trace, grasping, lab), time=lab.world.time)
    return trace


class _Grasping:
    """Where the object was grasped in a run, and how it is grasped elsewhere."""

    tell: TrialLog

    def __init__(
        self, trial: Trial, task: Task, lab: Laboratory, eyes: Eyes, picker: Picker
    ) -> None:
        self._task, self._lab, self._eyes, self._picker = task, lab, eyes, picker
        point = np.array(task.scene.manipulation_point)
        along = lab.settings.bullet.placement.tool_pose(1, point)[:3, 2]
        self._looks = trial.settings.looks
        self.hand = Hand(lab.world, lab.planner, along, trial.seed)
        self.points: list[Point] = []
        """Every point of the object at rest at which it was grasped, in order."""
        self.apart = 0.0
        """How far the goal is from the object where the other arm holds it, in metres."""
        self._chosen: tuple[Cloud, Choice, float] | None = None
        """What was seen, what was chosen, and when."""

    def begin(self) -> Point:
        """Set the object down, look at it, and grasp it where the picker says.

        Raises:
            NoGrasp: If it can be grasped nowhere.
            Unreachable, EmptyGrasp: If the scene cannot be set up.
            ShortCloud: If the camera does not see the object.
        """
        self._lab.world.reset(self._task.scene)
        why = self._grasp()
        if why:
            raise NoGrasp(why)
        return self.points[-1]

    def again(self) -> str:
        """Grasp the object elsewhere; return why it could not be, if so."""
        known = len(self.hand.motions)
        why = self._grasp()
        self.tell.moved(self.hand.motions[known:])
        if not why:
            self.tell_choice()
            where = np.round(self.points[-1], 4).tolist()
            self.tell.note(f"grasped again, at {where} m", time=self._lab.world.time)
        return why

    def tell_choice(self) -> None:
        """Write down where the object was grasped last, and why there."""
        if self._chosen is not None:
            initial, choice, time = self._chosen
            self.tell.chosen(initial, choice, self.points[-1], time=time)

    def _grasp(self) -> str:
        self.hand.let_go()
        initial, time = self._initial(), self._lab.world.time
        self.apart = held_end_apart(initial, self._task.goal.cloud, self._task.scene.hold)
        choice = self._picker.pick(initial, self._task.goal.cloud)
        point, why = self.hand.grasp(list(candidates(choice, initial, self.points)))
        if point is None:
            return why
        self.points.append(point)
        self._chosen = initial, choice, time
        return ""

    def _initial(self) -> Cloud:
        """Return what is seen before the grasp; a camera that drops an image is asked again."""
        for _ in range(self._looks - 1):
            with suppress(ShortCloud):
                return self._eyes.look("way").cloud
        return self._eyes.look("way").cloud


def _another_object(apart: float) -> str:
    off = f"{apart * 1e3:.1f} mm off the object where the other arm holds it"
    return (
        f"the goal is {off} (limit {LIMIT * 1e3:.0f} mm):"
        " is it the goal of another object, or of this one in another place?"
    )


def _meta(trial: Trial, task: Task, lab: Laboratory, point: Point) -> EpisodeMeta:
    name = f"servo-{task.goal.source.replace('.mcap:', '-').replace(':', '-')}"
    settings = lab.settings.describe() | _asked(trial)
    settings |= {
        "goal": task.goal.source,
        "true_point": list(task.scene.manipulation_point),
    }
    return EpisodeMeta(name, trial.seed, 0, at(task.scene, point), settings)


def _asked(trial: Trial) -> dict[str, Any]:
    """Return what decides about a run besides its goal and its laboratory, as in JSON."""
    checkpoint = trial.checkpoint.name if trial.checkpoint else f"dnet {dnet.__version__}"
    return {
        "controller": trial.controller,
        "checkpoint": checkpoint if trial.controller in LEARNED else None,
        "grasp": trial.grasp,
        "servo": asdict(trial.settings),
        "occlusion": trial.occlusion,
        "dropped": trial.dropped,
    }


def _result(trace: Trace, grasping: _Grasping, lab: Laboratory) -> dict[str, Any]:
    """Return what a run says of itself at its end, besides its outcome."""
    return {
        "motions": sum(step.plan is not None for step in trace.steps),
        "grasped": [point.tolist() for point in grasping.points],
        "held_end_apart": grasping.apart,
        "holding": bool(np.isfinite(lab.world.slip())),
        "arms": pose_of(lab.world.joints),
    }


def is_finished(trial: Trial) -> bool:
    """Return whether the directory of a trial holds the whole run that it asks for.

    Raises:
        OtherRun: If it holds one with other settings.
    """
    path = trial.out / RUN
    if not path.is_file():
        return False
    with EpisodeReader(path) as run:
        settings = run.meta.settings | {"seed": run.meta.seed}
        asked = _asked(trial) | {"seed": trial.seed, "world": trial.laboratory.world}
        for name, wanted in asked.items():
            if settings.get(name) != wanted:
                raise OtherRun(trial.out, name, settings.get(name), wanted)
        return run.finished and (run.result or {}).get("outcome") != "interrupted"


def clear(out: Path) -> None:
    """Remove what a stopped run left."""
    for name in (RUN, RECORDING, LATENCY, REFUSED):
        for path in (out / name, out / f"{name}.part"):
            path.unlink(missing_ok=True)


def refuse(out: Path, error: DnetError) -> None:
    """Write down why a run could not begin: it counts like any other."""
    write_whole(out / REFUSED, json.dumps({"error": str(error)}).encode())
