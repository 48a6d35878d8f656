"""What a servo run leaves: an episode, a Rerun recording, latencies, and lines for people."""

import json
import shutil
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from jaxtyping import Float64, Int64

from dnet.errors import DiskAlmostFull
from dnet.laboratory import Laboratory
from dnet.recorders.episode import EpisodeWriter
from dnet.recorders.rerun_run import RerunRun
from dnet.recorders.run_sinks import OpenView
from dnet.recorders.step_text import describe_latency, describe_step
from dnet.servo.grasping import Motion
from dnet.servo.pickers import Choice
from dnet.sim.urdf import psm_urdf
from dnet.trials.request import LATENCY, RECORDING, RUN
from dnet.types import ARMS, Cloud, EpisodeMeta, Goal, Joints, Plan, Point, Step, Trace

PICTURES = 10
"""Of the moving arm in a Rerun recording, a second of simulation."""
TIPS = 50
"""Positions of its tip on a planned path, likewise: 4 mm apart."""
RESERVE = 32_000_000
"""Bytes that must be free before each step: enough to write it, and to end all files whole."""

Times = Float64[np.ndarray, "_"]
Rows = Int64[np.ndarray, "_"]
Say = Callable[[str], None]
Free = Callable[[Path], int]


def free_bytes(folder: Path) -> int:
    """Return how much room the disk of a folder has."""
    return shutil.disk_usage(folder).free


class TrialLog:
    """Writes each step to all of them while the run goes on."""

    def __init__(
        self,
        out: Path,
        meta: EpisodeMeta,
        lab: Laboratory,
        *,
        say: Say,
        recording: bool = True,
        view: OpenView | None = None,
        free: Free = free_bytes,
    ) -> None:
        """Start the files of a run.

        Args:
            out: Directory for them.
            meta: What is known of the run.
            lab: Where it happens.
            say: Shows a line to people.
            recording: Whether to write a Rerun recording.
            view: Opens a window that shows the recording while it is written; None for none.
            free: Says how much room a folder has.

        Raises:
            OccupiedOutput: If there is a run already.
            NoSpace: If there is no room for one.
        """
        self._out, self._arms, self._say, self._free = out, lab.arms, say, free
        out.mkdir(parents=True, exist_ok=True)
        self._check()
        self._files = ExitStack()
        self._episode = self._files.enter_context(
            EpisodeWriter(
                out / RUN,
                meta,
                arms=lab.arms,
                attachments=lab.attachments(meta.scene.tissue),
                camera=lab.settings.bullet.camera,
            )
        )
        self._recording = None
        if recording:
            self._recording = self._files.enter_context(
                RerunRun(
                    out / RECORDING,
                    name=meta.episode_id,
                    arms=lab.arms,
                    urdf=psm_urdf(),
                    view=view,
                    say=say,
                )
            )
        self._latencies = self._files.enter_context((out / LATENCY).open("w", encoding="utf-8"))

    def __enter__(self) -> "TrialLog":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._files.__exit__(kind, error, trace)

    def start(self, goal: Goal, motions: Sequence[Motion]) -> None:
        """Write the shape to reach, and how the arm came to grasp the object."""
        self._episode.set_goal(goal.cloud, again=goal.again, nodes=goal.nodes, grasp=goal.grasp)
        if self._recording is not None:
            self._recording.log_target(goal)
        self.moved(motions)

    def chosen(self, initial: Cloud, choice: Choice, point: Point, *, time: float) -> None:
        """Write where the object is grasped, what it looked like before, and why there."""
        if self._recording is not None:
            self._recording.log_choice(
                initial, point, heat=choice.scores, keypoints=choice.keypoints, time=time
            )

    def moved(self, motions: Sequence[Motion]) -> None:
        """Write motions of the arm outside of the loop."""
        for one in motions:
            plan = one.plan
            why = f" ({plan.reason})" if plan.reason else ""
            if self._recording is not None:
                self._recording.log_pose(one.joints, time=one.time)
            self._log_way(one.time, plan)
            self.note(f"{one.what}: plan {plan.status}{why}", time=one.time)

    def note(self, text: str, *, time: float) -> None:
        """Write a line for people, at `time`."""
        self._episode.log(text, time=time, name="servo")
        if self._recording is not None:
            self._recording.log_text(text, time=time)

    def warn(self, text: str, *, time: float) -> None:
        """Write a line and show it to people now."""
        self.note(text, time=time)
        self._say(f"warning: {text}")

    def add(self, index: int, step: Step) -> None:
        """Write one step, and the way of the arm until the next.

        Raises:
            NoSpace: If the disk is nearly full: what is written could not be ended whole.
        """
        self._check()
        self._episode.add_step(step, index)
        if self._recording is None:
            return
        tips = None
        if step.plan is not None:
            self._log_way(step.frame.time, step.plan)
            tips = self._arms.tips(step.plan.path[_rows(step.plan.times, TIPS)])
        self._recording.log_step(index, step, tips)

    def timed(self, index: int, step: Step) -> None:
        """Write how long a step took, and say all of it."""
        self._say(f"{describe_step(step, index)}{describe_latency(step)}")
        if step.latency is not None:
            self._latencies.write(json.dumps({"step": index, **asdict(step.latency)}) + "\n")
            self._latencies.flush()
            if self._recording is not None:
                self._recording.log_latency(index, step)

    def finish(self, trace: Trace, result: dict[str, Any], *, time: float) -> None:
        """Write how the run ended, and when: in seconds of simulation."""
        if trace.last is not None:
            self._episode.add(trace.last)
            if self._recording is not None:
                self._recording.log_frame(trace.last)
        text = f"outcome: {trace.outcome}" + (f" ({trace.reason})" if trace.reason else "")
        self.note(text, time=time)
        chamfers = [step.chamfer for step in trace.steps]
        self._episode.finish(
            {"outcome": trace.outcome, "reason": trace.reason, "chamfer": chamfers, **result}
        )

    def _log_way(self, start: float, plan: Plan) -> None:
        if self._recording is not None:
            rows = _rows(plan.times, PICTURES)
            self._recording.log_way(start + plan.times[rows], plan.path[rows])

    def _check(self) -> None:
        free = self._free(self._out)
        if free < RESERVE:
            raise DiskAlmostFull(self._out, free, RESERVE)


def _rows(times: Times, rate: int | float) -> Rows:
    """Return rows of a timed path, so many a second, both ends among them."""
    count = min(len(times), int(np.ceil((times[-1] - times[0]) * rate)) + 1)
    return np.unique(np.linspace(0, len(times) - 1, count).round().astype(np.int64))


def pose_of(joints: tuple[Joints, Joints]) -> dict[str, list[float]]:
    """Return joint positions by arm, as JSON would have them."""
    return {arm: positions.tolist() for arm, positions in zip(ARMS, joints, strict=True)}
