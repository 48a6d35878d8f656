"""What a servo run leaves: an episode, a Rerun recording, and a line a step on the terminal."""

from contextlib import ExitStack
from pathlib import Path
from types import TracebackType

import numpy as np
from rich.console import Console

from dnet.laboratory import Laboratory
from dnet.recorders.episode import EpisodeWriter
from dnet.recorders.rerun_run import RerunRun
from dnet.recorders.step_text import describe_step
from dnet.sim.urdf import psm_urdf
from dnet.types import EpisodeMeta, Goal, Step, Trace

EPISODE = "run.mcap"
RECORDING = "run.rrd"


class ServoLog:
    """Writes each step to all three while the run goes on."""

    def __init__(self, out: Path, meta: EpisodeMeta, lab: Laboratory, console: Console) -> None:
        """Start the files of a run in `out`."""
        self._arms, self._console = lab.arms, console
        self._files = ExitStack()
        self._episode = self._files.enter_context(
            EpisodeWriter(
                out / EPISODE,
                meta,
                arms=lab.arms,
                attachments=lab.attachments(meta.scene.tissue),
                camera=lab.settings.bullet.camera,
            )
        )
        self._recording = self._files.enter_context(
            RerunRun(out / RECORDING, name=meta.episode_id, arms=lab.arms, urdf=psm_urdf())
        )

    def __enter__(self) -> "ServoLog":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._files.__exit__(kind, error, trace)

    def start(self, goal: Goal) -> None:
        """Write the shape to reach."""
        self._episode.set_goal(goal.cloud)
        self._recording.log_goal(goal.cloud)

    def add(self, index: int, step: Step) -> None:
        """Write one step, and the way of the arm until the next."""
        self._episode.add_step(step, index)
        self._console.print(describe_step(step, index), highlight=False)
        if step.plan is None:
            self._recording.log_step(index, step, None)
            return
        holding, path = step.frame.joints[0], step.plan.path
        tips = np.array([self._arms.tip(joints) for joints in path])
        self._recording.log_step(index, step, tips)
        still = np.tile(holding, (len(path), 1))
        self._recording.arms_along(step.frame.time + step.plan.times, (still, path))

    def finish(self, trace: Trace) -> None:
        """Write how the run ended."""
        chamfers = [step.chamfer for step in trace.steps]
        self._episode.finish({"outcome": trace.outcome, "chamfer": chamfers})
        self._recording.log_text(f"outcome: {trace.outcome}")
