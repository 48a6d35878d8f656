"""An episode shown again: its frames in a Rerun recording with the layout of a run."""

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from jaxtyping import Float64

from dnet.errors import BadEpisode
from dnet.geometry.chamfer_to import ChamferTo
from dnet.recorders.blueprint import (
    COMPARISON_APPLICATION,
    RECORDING_APPLICATION,
    SERVO_APPLICATION,
    Company,
    comparison_blueprint,
    recording_blueprint,
    servo_blueprint,
)
from dnet.recorders.frame_columns import COUNTER, Block, FrameColumns
from dnet.recorders.goal_distance import GoalDistance
from dnet.recorders.keypoints import log_keypoint, log_rest_shape
from dnet.recorders.rerun_scene import RerunScene
from dnet.recorders.robot_description import read_urdf
from dnet.recorders.streams import open_stream, saved_stream
from dnet.types import EpisodeMeta, Frame, Goal, Place, Point, Transform

URDF = "psm.urdf"
JOINT_NAMES = ("yaw", "pitch", "insertion", "roll", "wrist_pitch", "wrist_yaw")
"""Of one arm, in the order of the format."""
FRAMES_AT_A_TIME = 64
"""Frames in memory at a time: an episode may be longer than that is large."""


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

    def target(self) -> Goal | None:
        """Return the shape to reach with all that is known of it, if there is one."""
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


OpenEpisode = Callable[[Place], RecordedEpisode]


def replay(episode: RecordedEpisode, path: Path, *, company: Company | None = "alone") -> float:
    """Write `episode` as the Rerun recording `path`; return the time that shows it best.

    A servo run shows its goal, and the motion that was asked for as an arrow. A recording has
    neither: it shows its rest shape, and the motion of the grasp since. The same episode always
    becomes a recording of the same id, so that a viewer that opens it twice has it once.

    Args:
        episode: What to show.
        path: The `.rrd` to write.
        company: What its layout is for; None brings none along, for where several are opened
            together, one layout does for all of an application.

    Raises:
        BadEpisode: If a part of the episode cannot be read.
        Unwritten: If the recording cannot be written.
    """
    goal = episode.target()
    recording = open_stream(
        application(episode), recording_id=_recording_id(episode.path, episode.meta.episode_id)
    )
    # When it was replayed says nothing of when it was recorded.
    recording.set_log_time_enabled(False)
    with saved_stream(recording, path, blueprint=_layout(goal, company)):
        recording.send_recording_name(episode.meta.episode_id)
        scene = _scene(recording, episode)
        scene.name_joints(JOINT_NAMES)
        log_keypoint(recording, "hold", np.array(episode.meta.scene.hold))
        columns = FrameColumns(recording, plain=goal is None or not len(goal.cloud))
        columns.send_lines(episode.lines())
        if goal is None:
            return _replay_shapes(episode, recording, columns)
        scene.log_goal(goal.cloud)
        return _replay_run(episode, scene, columns, goal)


def replay_beside(episodes: Sequence[RecordedEpisode], path: Path) -> float:
    """Write servo runs side by side as the Rerun recording `path`; return the time of their end.

    Args:
        episodes: Two runs or more, each with a goal.
        path: The `.rrd` to write.

    Raises:
        BadEpisode: If one of them is no servo run, or a part of it cannot be read.
        Unwritten: If the recording cannot be written.
    """
    recording = open_stream(
        COMPARISON_APPLICATION,
        recording_id=_recording_id(path, "+".join(str(one.path) for one in episodes)),
    )
    recording.set_log_time_enabled(False)
    names = [place_of(number) for number in range(len(episodes))]
    titles = {name: _title(episode) for name, episode in zip(names, episodes, strict=True)}
    end = 0.0
    with saved_stream(recording, path, blueprint=comparison_blueprint(titles)):
        recording.send_recording_name(" | ".join(titles.values()))
        for name, episode in zip(names, episodes, strict=True):
            goal = episode.target()
            if goal is None:
                raise BadEpisode(episode.path, "is no servo run", "play it by itself")
            scene = _scene(recording, episode, place=name)
            scene.name_joints(JOINT_NAMES)
            columns = FrameColumns(recording, plain=not len(goal.cloud), place=name)
            columns.send_lines(episode.lines())
            scene.log_goal(goal.cloud)
            end = max(end, _replay_run(episode, scene, columns, goal))
    return end


def place_of(number: int) -> str:
    """Return where the scene of a run hangs, by its number from 0."""
    return f"run_{number + 1}"


def _title(episode: RecordedEpisode) -> str:
    controller = episode.meta.settings.get("controller", "")
    goal = episode.meta.settings.get("goal", episode.meta.episode_id)
    return f"{controller} to {goal}" if controller else str(goal)


def application(episode: RecordedEpisode) -> str:
    """Return the application that an episode is a recording of."""
    return RECORDING_APPLICATION if episode.target() is None else SERVO_APPLICATION


def _layout(goal: Goal | None, company: Company | None) -> rrb.Blueprint | None:
    if company is None:
        return None
    if goal is None:
        return recording_blueprint(company=company)
    return servo_blueprint(gripper=True, company=company)


def _replay_shapes(
    episode: RecordedEpisode, recording: rr.RecordingStream, columns: FrameColumns
) -> float:
    """Send a recording; return the time of its largest motion."""
    if not len(episode):
        return 0.0
    rest = episode.frame(0)
    log_rest_shape(recording, rest.cloud)
    distance = ChamferTo(rest.cloud) if len(rest.cloud) else None
    best, largest = rest.time, 0.0
    for block in _blocks(episode):
        columns.send_frames(block)
        columns.send_motions(block, rest.grasp)
        if distance is not None:
            columns.send_distances(block, distance)
        for one in block.frames:
            length = float(np.linalg.norm(one.grasp - rest.grasp))
            if length > largest:
                best, largest = one.time, length
    return best


def _replay_run(
    episode: RecordedEpisode, scene: RerunScene, columns: FrameColumns, goal: Goal
) -> float:
    """Send a servo run; return the time of its end."""
    distance = GoalDistance(goal) if len(goal.cloud) else None
    seen: dict[float, tuple[int, Point]] = {}
    for block in _blocks(episode):
        columns.send_frames(block)
        if distance is not None:
            columns.send_errors(block, distance)
        for index, one in enumerate(block.frames, start=block.first):
            seen[one.time] = index, one.grasp
    for step in episode.steps():
        if step["time"] in seen:
            index, grasp = seen[step["time"]]
            scene.set_time(step["time"], count=index)
            scene.log_motion(grasp, np.array(step["motion"], dtype=np.float64))
            scene.log_tip_path(_planned(episode, step, grasp))
    return max(seen, default=0.0)


def _blocks(episode: RecordedEpisode) -> Iterator[Block]:
    for first in range(0, len(episode), FRAMES_AT_A_TIME):
        numbers = range(first, min(first + FRAMES_AT_A_TIME, len(episode)))
        yield Block(
            first,
            [episode.frame(number) for number in numbers],
            [episode.transforms(number) for number in numbers],
        )


def _planned(
    episode: RecordedEpisode, step: Mapping[str, Any], grasp: Point
) -> Float64[np.ndarray, "2 3"] | None:
    """Return where the tip was planned to go: both ends of its path, all that an episode keeps."""
    plan = step.get("plan")
    if plan is None:
        return None
    try:
        if plan["status"] == "failed":
            return None
        achieved = np.array(plan["achieved"], dtype=np.float64).reshape(3)
    except (KeyError, TypeError, ValueError) as error:
        why = f"has an unreadable plan at {step['time']:g} s ({error})"
        raise BadEpisode(episode.path, why, "record it again") from error
    return np.stack([grasp, grasp + achieved])


def _recording_id(path: Place, episode: str) -> str:
    # Where it lies, too: two datasets of one seed have episodes of the same names.
    place = path if isinstance(path, str) else path.resolve()
    return hashlib.sha256(f"{episode}\n{place}".encode()).hexdigest()[:32]


def _scene(
    recording: rr.RecordingStream, episode: RecordedEpisode, *, place: str = ""
) -> RerunScene:
    urdf = episode.attachment(URDF) if URDF in episode.attachments else b""
    try:
        text = read_urdf(urdf) if urdf else ""
        return RerunScene(recording, urdf=text, counter=COUNTER, place=place)
    except (ValueError, RuntimeError) as error:
        why = f"has an unreadable attachment {URDF} ({error})"
        raise BadEpisode(episode.path, why, "record it again") from error
