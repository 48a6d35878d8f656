"""An episode shown again: its frames logged to a Rerun recording with the layout of a run."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
import rerun as rr

from dnet.errors import BadEpisode
from dnet.geometry.chamfer import chamfer
from dnet.recorders.blueprint import (
    RECORDING_APPLICATION,
    SERVO_APPLICATION,
    recording_blueprint,
    servo_blueprint,
)
from dnet.recorders.rerun_scene import CHAMFER, RerunScene
from dnet.types import Cloud, EpisodeMeta, Frame, Place, Transform

URDF = "psm.urdf"


@runtime_checkable
class RecordedEpisode(Protocol):
    """What a replay asks of an episode that is being read."""

    meta: EpisodeMeta

    @property
    def path(self) -> Place:
        """Where it came from, for errors."""
        ...

    @property
    def attachments(self) -> tuple[str, ...]:
        """Names of the attached files."""
        ...

    def __len__(self) -> int: ...

    def frame(self, index: int) -> Frame:
        """Return one frame."""
        ...

    def transforms(self, index: int) -> Sequence[Transform]:
        """Return the arms' links at one frame."""
        ...

    def goal(self) -> Cloud | None:
        """Return the shape to reach, if there is one."""
        ...

    def steps(self) -> Sequence[Mapping[str, Any]]:
        """Return the turns of the servo loop, if it was one."""
        ...

    def lines(self) -> Sequence[tuple[float, str]]:
        """Return times and texts of the log."""
        ...

    def attachment(self, name: str) -> bytes:
        """Return an attached file."""
        ...

    def close(self) -> None:
        """Let go of the file."""
        ...


OpenEpisode = Callable[[Path], RecordedEpisode]


def replay(episode: RecordedEpisode, path: Path) -> float:
    """Write `episode` as the Rerun recording `path`; return the time that shows it best.

    A servo run shows its goal. A recording has none: its last shape stands in for it, green and
    labelled so, and the arrow is the motion of the grasp since the rest shape.

    Raises:
        BadEpisode: If a part of the episode cannot be read.
    """
    goal = episode.goal()
    recording = rr.RecordingStream(RECORDING_APPLICATION if goal is None else SERVO_APPLICATION)
    # When it was replayed says nothing of when it was recorded.
    recording.set_log_time_enabled(False)
    try:
        layout = recording_blueprint() if goal is None else servo_blueprint()
        recording.save(path, default_blueprint=layout)
        recording.send_recording_name(episode.meta.episode_id)
        scene = _scene(recording, episode)
        frames = [episode.frame(index) for index in range(len(episode))]
        if goal is not None:
            _log_frames(scene, episode, frames, goal)
            _log_steps(scene, episode, frames)
        elif frames:
            last = frames[_last_shape(frames)].cloud
            _log_frames(scene, episode, frames, last, label="last shape")
            _log_motions(scene, frames)
        for time, text in episode.lines():
            scene.set_time(time)
            scene.log_text(text)
    finally:
        recording.flush()
        recording.disconnect()
    return _best_time(frames, servo=goal is not None)


def _scene(recording: rr.RecordingStream, episode: RecordedEpisode) -> RerunScene:
    urdf = episode.attachment(URDF) if URDF in episode.attachments else b""
    try:
        return RerunScene(recording, urdf=urdf.decode(), counter="frame")
    except (ValueError, RuntimeError) as error:
        why = f"has an unreadable attachment {URDF} ({error})"
        raise BadEpisode(episode.path, why, "record it again") from error


def _log_frames(
    scene: RerunScene,
    episode: RecordedEpisode,
    frames: Sequence[Frame],
    goal: Cloud,
    *,
    label: str = "goal",
) -> None:
    scene.log_goal(goal, label=label)
    for index, frame in enumerate(frames):
        scene.set_time(frame.time, count=index)
        scene.log_frame(frame, episode.transforms(index))
        if frame.kind != "way" and len(goal) and len(frame.cloud):
            scene.log_scalar(CHAMFER, 1e3 * chamfer(frame.cloud, goal))


def _log_motions(scene: RerunScene, frames: Sequence[Frame]) -> None:
    rest = frames[0].grasp
    for index, frame in enumerate(frames):
        scene.set_time(frame.time, count=index)
        scene.log_motion(rest, frame.grasp - rest)


def _log_steps(scene: RerunScene, episode: RecordedEpisode, frames: Sequence[Frame]) -> None:
    at = {frame.time: (index, frame.grasp) for index, frame in enumerate(frames)}
    for step in episode.steps():
        if step["time"] in at:
            index, grasp = at[step["time"]]
            scene.set_time(step["time"], count=index)
            scene.log_motion(grasp, np.array(step["motion"], dtype=np.float64))


def _last_shape(frames: Sequence[Frame]) -> int:
    """Return the last frame that had settled, or the last of all."""
    settled = [index for index, frame in enumerate(frames) if frame.kind != "way"]
    return settled[-1] if settled else len(frames) - 1


def _best_time(frames: Sequence[Frame], *, servo: bool) -> float:
    """Return when there is most to see: a servo run's end, a recording's largest motion.

    The last shape of a recording stands for the goal and would hide behind itself, so another
    frame is chosen if there is one.
    """
    if not frames:
        return 0.0
    if servo or len(frames) == 1:
        return frames[-1].time
    last = _last_shape(frames)
    others = [frame for index, frame in enumerate(frames) if index != last]
    rest = frames[0].grasp
    return max(others, key=lambda frame: float(np.linalg.norm(frame.grasp - rest))).time
