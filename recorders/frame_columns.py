"""Frames of an episode sent to Rerun as columns, many at a time, for one by one is slow."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr
from jaxtyping import Float64

from dnet.geometry.chamfer_to import ChamferTo
from dnet.recorders.goal_distance import GoalDistance
from dnet.recorders.link_rows import LinkRows, placed, time_column
from dnet.recorders.rerun_scene import (
    CHAMFER,
    CURRENT,
    CURRENT_COLOR,
    DISTANCES,
    JOINTS,
    LOG,
    MANIPULATION_POINT,
    MOTION,
    MOTION_LENGTH,
    TIME_TIMELINE,
    TRUE_MOTION,
)
from dnet.types import ARMS, Frame, Point, Transform

COUNTER = "frame"
"""Name of the timeline that counts the frames."""
GRIPPER = "gripper"

AXIS_COLORS = ((230, 120, 70), (60, 190, 140), (100, 180, 240))
"""Of x, y and z: vermilion, green and blue that colour-blind people tell apart."""


@dataclass(frozen=True, slots=True)
class Block:
    """Frames that follow each other, and where the links of both arms stood at each."""

    first: int
    """Number of the first one."""
    frames: Sequence[Frame]
    transforms: Sequence[Sequence[Transform]]


class FrameColumns:
    """Sends blocks of frames to the entities to which a `RerunScene` logs one at a time."""

    def __init__(
        self, recording: rr.RecordingStream, *, plain: bool = True, place: str = ""
    ) -> None:
        self._recording, self._place = recording, place
        self._links = LinkRows(recording, place=place)
        looks: dict[str, rr.AsComponents] = {
            GRIPPER: rr.SeriesLines(names=["x", "y", "z"], colors=AXIS_COLORS, widths=[2, 2, 2]),
        }
        if plain:
            # Points that are coloured by how far they are from the goal change: a colour that is
            # said once would hide theirs.
            looks[CURRENT] = rr.Points3D.from_fields(colors=CURRENT_COLOR)
        for entity, look in looks.items():
            recording.log(placed(place, entity), look, static=True)

    def send_frames(self, block: Block) -> None:
        """Send what was seen and where the arms were."""
        frames = block.frames
        clouds = rr.Points3D.columns(positions=np.concatenate([one.cloud for one in frames]))
        self._send(block, CURRENT, clouds.partition([len(one.cloud) for one in frames]))
        grasps = _grasps(block)
        self._send(block, MANIPULATION_POINT, rr.Points3D.columns(positions=grasps))
        self._send(block, GRIPPER, rr.Scalars.columns(scalars=1e3 * grasps))
        for number, arm in enumerate(ARMS):
            positions = np.stack([one.joints[number] for one in frames])
            self._send(block, f"{JOINTS}/{arm}", rr.Scalars.columns(scalars=positions))
        self._send_transforms(block)

    def send_motions(self, block: Block, rest: Point) -> None:
        """Send the motion of the grasp since it was at `rest`: arrows, and a curve."""
        motions = _grasps(block) - rest
        arrows = rr.Arrows3D.columns(origins=np.tile(rest, (len(motions), 1)), vectors=motions)
        self._send(block, MOTION, arrows)
        lengths = 1e3 * np.linalg.norm(motions, axis=1)
        self._send(block, MOTION_LENGTH, rr.Scalars.columns(scalars=lengths))

    def send_distances(self, block: Block, distance: ChamferTo) -> None:
        """Send how far each settled shape is from another."""
        rows = [row for row, one in enumerate(block.frames) if one.kind != "way" and len(one.cloud)]
        if rows:
            values = [1e3 * distance(block.frames[row].cloud) for row in rows]
            self._send(block, CHAMFER, rr.Scalars.columns(scalars=values), rows=rows)

    def send_errors(self, block: Block, distance: GoalDistance) -> None:
        """Send how far each frame is from the goal of a run: colours, curves, the true motion."""
        rows = [row for row, one in enumerate(block.frames) if len(one.cloud)]
        if not rows:
            return
        found = [distance(block.frames[row]) for row in rows]
        colors = rr.Points3D.columns(colors=np.concatenate([one.colors for one in found]))
        self._send(block, CURRENT, colors.partition([len(one.colors) for one in found]), rows=rows)
        for name in found[0].figures:
            curves = [[one.figures[name] for one in found]]
            if name in distance.floor:
                curves.append([distance.floor[name]] * len(found))
            values = rr.Scalars.columns(scalars=np.column_stack(curves))
            self._send(block, DISTANCES[name], values, rows=rows)
        motions = [one.motion for one in found if one.motion is not None]
        if motions:
            origins = [block.frames[row].grasp for row in rows]
            arrows = rr.Arrows3D.columns(origins=origins, vectors=motions)
            self._send(block, TRUE_MOTION, arrows, rows=rows)

    def send_lines(self, lines: Sequence[tuple[float, str]]) -> None:
        """Send times and texts of the log, on the time line alone."""
        if lines:
            times, texts = zip(*lines, strict=True)
            self._recording.send_columns(
                placed(self._place, LOG),
                indexes=[rr.TimeColumn(TIME_TIMELINE, duration=times)],
                columns=rr.TextLog.columns(text=texts, level=["INFO"] * len(texts)),
            )

    def _send_transforms(self, block: Block) -> None:
        entries = [entry for frame in block.transforms for entry in frame]
        at = [row for row, frame in enumerate(block.transforms) for _ in frame]
        self._links.send(entries, _indexes(block, at))

    def _send(
        self,
        block: Block,
        entity: str,
        columns: Iterable[rr.ComponentColumn],
        *,
        rows: Sequence[int] | None = None,
    ) -> None:
        """Send a column with a value at each of some rows of a block, by default at all."""
        at = range(len(block.frames)) if rows is None else rows
        self._recording.send_columns(
            placed(self._place, entity),
            indexes=_indexes(block, at),
            columns=columns,
        )


def _indexes(block: Block, rows: Sequence[int]) -> list[rr.TimeColumn]:
    """Return when some rows of a block were, on both timelines."""
    return [
        rr.TimeColumn(COUNTER, sequence=[block.first + row for row in rows]),
        time_column(TIME_TIMELINE, np.array([block.frames[row].time for row in rows])),
    ]


def _grasps(block: Block) -> Float64[np.ndarray, "_ 3"]:
    return np.stack([one.grasp for one in block.frames])
