"""What the messages of an episode say: numbers, units, and whether they agree with each other."""

from collections.abc import Callable

import numpy as np

from dnet.datasets import messages
from dnet.datasets.point_cloud import NotFinite, read_point_cloud
from dnet.datasets.reader import (
    CALIBRATION,
    CLOUD,
    DEPTH,
    FRAME,
    GOAL,
    GRIPPER,
    JOINTS,
    LOG,
    MASK,
    NODES,
    POINT,
    STEP,
    TRANSFORMS,
)
from dnet.tools.validate_findings import Findings

LARGEST_COORDINATE = 10.0
"""Metres from the origin, or of depth, that are still believed. The laboratory is 1 m wide and its
objects 0.1 m long: in millimetres, a thousand times as much, nothing of them would be so near."""
LARGEST_JOINT = 2 * np.pi
"""Radians, or metres of insertion, of a joint that are still believed. The widest reaches 4.6 rad
to either side: in degrees nearly every position would be beyond this."""
QUATERNION_TOLERANCE = 1e-6
"""How far the length of a quaternion may be from 1: float64 stays within 1e-12, float32 within
1e-6."""

_Value = tuple[float, ...]


class ValueChecks:
    """Checks of what each message says, in file order.

    Args:
        findings: Takes what is wrong with them.
    """

    def __init__(self, findings: Findings) -> None:
        self._findings = findings
        self._sizes: dict[str, int] = {}
        self._waiting: dict[tuple[str, int], _Value] = {}
        self._frames = 0
        self._steps = 0
        self._image: tuple[int, int] | None = None
        self._read: dict[str, Callable[[str, int, memoryview], None]] = {
            CLOUD: self._cloud,
            NODES: self._cloud,
            GOAL: self._goal,
            POINT: self._point,
            JOINTS: self._joints,
            TRANSFORMS: self._transforms,
            GRIPPER: self._gripper,
            CALIBRATION: self._calibration,
            DEPTH: self._depth,
            MASK: self._mask,
            STEP: self._step,
            LOG: self._log,
        }

    @property
    def points(self) -> int | None:
        """Points of the first cloud; None before there is one."""
        return self._sizes.get(CLOUD)

    def take(self, topic: str, number: int, *, time: int, content: memoryview) -> None:
        """Check a message.

        Args:
            topic: Of its channel.
            number: How many there were of that topic before it.
            time: Its log time in nanoseconds.
            content: What is in it.
        """
        try:
            # Numbers of any size are judged, not warned of.
            with np.errstate(all="ignore"):
                self._take(topic, number, time, content)
        except NotFinite as error:
            self._findings.error("not-finite", f"{topic} {number}: {error}")
        except messages.UNREADABLE as error:
            self._findings.error("message", f"{topic} {number} is unreadable: {error}")

    def _take(self, topic: str, number: int, time: int, content: memoryview) -> None:
        if topic == FRAME:
            self._frame(number, time, content)
        elif topic in self._read:
            self._read[topic](topic, number, content)
        elif not number:
            self._findings.warn("topic", f"{topic} is no topic of an episode; it is not read")

    def _cloud(self, topic: str, number: int, content: memoryview) -> None:
        points = read_point_cloud(content)
        first = self._sizes.setdefault(topic, len(points))
        if len(points) != first:
            self._findings.error(
                "points", f"{topic} {number} has {len(points)}, the first one has {first}"
            )
        if not len(points):
            self._findings.error("points", f"{topic} {number} has none")
        self._near(topic, number, points)

    def _goal(self, topic: str, number: int, content: memoryview) -> None:
        self._near(topic, number, read_point_cloud(content))

    def _point(self, topic: str, number: int, content: memoryview) -> None:
        points = read_point_cloud(content)
        if len(points) != 1:
            raise ValueError(f"{len(points)} points, not 1")
        self._near(topic, number, points)
        self._match("grasp", number, tuple(points[0].tolist()), other="point")

    def _gripper(self, topic: str, number: int, content: memoryview) -> None:
        position, rotation = messages.read_placement(content)
        _finite(position, rotation)
        self._near(topic, number, position)
        self._unit(topic, number, rotation[None])
        self._match("point", number, tuple(position.astype(np.float32).tolist()), other="grasp")

    def _joints(self, topic: str, number: int, content: memoryview) -> None:
        positions = np.concatenate(messages.read_joints(content))
        _finite(positions)
        most = float(np.abs(positions).max())
        if most > LARGEST_JOINT:
            self._findings.error(
                "units", f"{topic} {number} has a joint at {most:.6g}, at most {LARGEST_JOINT:.4g}"
            )

    def _transforms(self, topic: str, number: int, content: memoryview) -> None:
        transforms = messages.read_transforms(content)
        if not transforms:
            raise ValueError("no transforms")
        translations = np.stack([one.translation for one in transforms])
        rotations = np.stack([one.rotation for one in transforms])
        _finite(translations, rotations)
        self._near(topic, number, translations)
        self._unit(topic, number, rotations)

    def _calibration(self, _topic: str, number: int, content: memoryview) -> None:
        _, width, height, _ = messages.read_calibration(content)
        if number:
            raise ValueError("there is one before it")
        self._image = height, width

    def _depth(self, topic: str, number: int, content: memoryview) -> None:
        depth = messages.read_depth(content)
        self._sized(topic, number, depth.shape)
        if depth.size and (depth.min() < 0 or depth.max() > LARGEST_COORDINATE):
            self._findings.error(
                "units",
                f"{topic} {number} is from {depth.min():.6g} to {depth.max():.6g} m, must be from "
                f"0 to {LARGEST_COORDINATE:g} m",
            )

    def _mask(self, topic: str, number: int, content: memoryview) -> None:
        self._sized(topic, number, messages.read_mask(content).shape)

    def _frame(self, number: int, time: int, content: memoryview) -> None:
        wanted = self._frames
        self._frames += 1
        index, kind, seconds = messages.read_frame_end(content)
        if index != wanted:
            self._findings.error(
                "frame-index", f"frame {number} says that it is {index}, not {wanted}"
            )
            self._frames = index + 1
        if number == 0 and kind != "rest":
            self._findings.warn("frame-kind", f"the first frame is of kind {kind}, not rest")
        if round(seconds * 1e9) != time:
            self._findings.error(
                "frame-time", f"frame {number} says that it is from {seconds} s, not {time} ns"
            )

    def _step(self, _topic: str, number: int, content: memoryview) -> None:
        wanted = self._steps
        self._steps += 1
        index = messages.read_step(content).get("index")
        if index != wanted:
            self._findings.error(
                "step-index", f"step {number} says that it is {index}, not {wanted}"
            )
            self._steps = index + 1 if isinstance(index, int) else self._steps

    def _log(self, _topic: str, _number: int, content: memoryview) -> None:
        messages.read_line(content)

    def _near(self, topic: str, number: int, values: np.ndarray) -> None:
        most = float(np.abs(values).max(initial=0.0))
        if most > LARGEST_COORDINATE:
            self._findings.error(
                "units",
                f"{topic} {number} has a coordinate of {most:.6g} m, at most "
                f"{LARGEST_COORDINATE:g} m are believed; is it in millimetres?",
            )

    def _unit(self, topic: str, number: int, rotations: np.ndarray) -> None:
        lengths = np.linalg.norm(rotations, axis=1)
        worst = int(np.abs(lengths - 1.0).argmax())
        if abs(lengths[worst] - 1.0) > QUATERNION_TOLERANCE:
            self._findings.error(
                "quaternion",
                f"{topic} {number} has a quaternion of length {lengths[worst]:.9g}, must be 1 "
                f"within {QUATERNION_TOLERANCE:g}",
            )

    def _sized(self, topic: str, number: int, shape: tuple[int, ...]) -> None:
        if self._image is None:
            self._findings.error("images", f"{topic} {number} comes before any calibration")
        elif shape != self._image:
            height, width = shape
            self._findings.error(
                "images",
                f"{topic} {number} is {width} x {height}, the calibration says "
                f"{self._image[1]} x {self._image[0]}",
            )

    def _match(self, what: str, number: int, value: _Value, *, other: str) -> None:
        """Compare a grasp with the point of its frame, whichever of them comes last."""
        wanted = self._waiting.pop((what, number), None)
        if wanted is None:
            self._waiting[other, number] = value
        elif wanted != value:
            self._findings.error(
                "grasp", f"frame {number} has a manipulation point and a gripper that differ"
            )


def _finite(*values: np.ndarray) -> None:
    if not all(np.isfinite(value).all() for value in values):
        raise NotFinite("NaN or infinity")
