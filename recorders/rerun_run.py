"""A servo run as a Rerun recording, written while it happens."""

from collections.abc import Callable
from pathlib import Path
from types import TracebackType

import numpy as np
from jaxtyping import Float64

from dnet.errors import OccupiedOutput
from dnet.recorders.arms import MovingArms
from dnet.recorders.blueprint import SERVO_APPLICATION, servo_blueprint
from dnet.recorders.choice import log_choice
from dnet.recorders.goal_distance import GoalDistance
from dnet.recorders.rerun_scene import CHAMFER, RerunScene
from dnet.recorders.run_sinks import OpenView, RunSinks
from dnet.recorders.step_text import describe_step
from dnet.recorders.streams import open_stream
from dnet.types import Cloud, Frame, Goal, JointPath, Joints, KeypointPairs, Point, Step


class RerunRun:
    """Writes a run as `path` + ".part", flushed at every step, and names it when it is closed.

    Leaving the `with` block by an exception leaves the `.part` file, which Rerun can open when
    it is renamed to end in `.rrd`.

    Args:
        path: Where the recording goes, an `.rrd`.
        name: What the viewer calls it.
        arms: Both arms.
        urdf: The URDF of one arm, drawn twice.
        view: Opens a window that shows the run while it goes on; None for none.
        say: Shows a line to people, if there is trouble with the window.

    Raises:
        OccupiedOutput: If `path` is already there.
    """

    def __init__(
        self,
        path: Path,
        *,
        name: str,
        arms: MovingArms,
        urdf: str,
        view: OpenView | None = None,
        say: Callable[[str], None] = print,
    ) -> None:
        if path.exists():
            raise OccupiedOutput(path, "a Rerun recording")
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path = path
        self.part = path.with_name(path.name + ".part")
        self._arms = arms
        self._now = 0.0
        self._step: int | None = None
        self._recording = open_stream(SERVO_APPLICATION)
        self._sinks = RunSinks(
            self._recording, self.part, blueprint=servo_blueprint(choice=True), view=view, say=say
        )
        self._recording.send_recording_name(name)
        self._scene = RerunScene(self._recording, urdf=urdf, counter="step")
        self._scene.name_joints(arms.joint_names)
        self._closed = False
        self._distance: GoalDistance | None = None

    def __enter__(self) -> "RerunRun":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if error is None:
            self.close()
        elif not self._closed:
            self._disconnect()

    def log_goal(self, cloud: Cloud) -> None:
        """Log the shape to reach, for all times."""
        self._scene.log_goal(cloud)
        self._sinks.flush()

    def log_target(self, goal: Goal) -> None:
        """Log the shape to reach, and what is known of it, for all times."""
        self.log_goal(goal.cloud)
        self._distance = GoalDistance(goal)

    def log_choice(
        self,
        initial: Cloud,
        point: Point,
        *,
        heat: Float64[np.ndarray, " n"] | None,
        keypoints: KeypointPairs | None,
        time: float,
    ) -> None:
        """Log where the object is grasped, and what that was chosen by, as `log_choice` does."""
        self._scene.set_time(time)
        log_choice(self._recording, initial, point, heat=heat, keypoints=keypoints)
        self._sinks.flush()

    def log_latency(self, index: int, step: Step) -> None:
        """Log how long the stages of a step took, at its time."""
        if step.latency is None:
            return
        self._scene.set_time(step.frame.time, count=index)
        self._scene.log_latency(step.latency)
        self._sinks.flush()

    def log_step(self, index: int, step: Step, tip_path: Float64[np.ndarray, "_ 3"] | None) -> None:
        """Log one turn of the servo loop and flush it.

        Args:
            index: Its number, from 0.
            step: What was seen and done.
            tip_path: Planned positions of the moving arm's tip, (n, 3), if there is a plan.
        """
        frame, plan = step.frame, step.plan
        self._now, self._step = frame.time, index
        scene = self._scene
        scene.set_time(frame.time, count=index)
        distances = None if self._distance is None else self._distance(frame, step.gaps)
        floor = None if self._distance is None else self._distance.floor
        scene.log_frame(frame, self._arms.links(frame.joints), distances, floor=floor)
        scene.log_motion(frame.grasp, step.motion)
        scene.log_tip_path(tip_path)
        if self._distance is None:
            scene.log_scalar(CHAMFER, 1e3 * step.chamfer)
        troubled = plan is not None and plan.status in ("partial", "failed")
        scene.log_text(describe_step(step, index), level="WARN" if troubled else "INFO")
        self._sinks.flush()

    def log_frame(self, frame: Frame) -> None:
        """Log a frame that was seen on the way from one step to the next."""
        self._scene.set_time(frame.time)
        self._scene.log_frame(frame, self._arms.links(frame.joints))
        self._sinks.flush()

    def log_pose(self, joints: tuple[Joints, Joints], *, time: float) -> None:
        """Log how both arms stand, outside of any step; it is flushed with what comes next."""
        self._scene.set_time(time)
        self._scene.log_links(self._arms.links(joints))
        self._scene.log_joints(joints)

    def log_way(self, times: Float64[np.ndarray, "_"], path: JointPath) -> None:
        """Log the moving arm on its way, so that playback is smooth; it is flushed likewise.

        Args:
            times: Seconds of simulation, (n,).
            path: Its joint positions at those times, (n, 6).
        """
        self._scene.log_way(times, path, self._arms.way(path))

    def log_text(self, message: str, *, time: float | None = None) -> None:
        """Log a line for people, at `time` or at that of the last step."""
        if time is None:
            self._scene.set_time(self._now, count=self._step)
        else:
            self._scene.set_time(time)
        self._scene.log_text(message)
        self._sinks.flush()

    def close(self) -> None:
        """Write what is left and give the recording its name; a second call does nothing.

        Raises:
            OccupiedOutput: If somebody else wrote `path` in the meantime.
        """
        if self._closed:
            return
        self._disconnect()
        if self.path.exists():
            raise OccupiedOutput(self.path, "a Rerun recording")
        self.part.replace(self.path)

    def _disconnect(self) -> None:
        self._closed = True
        self._sinks.close()
