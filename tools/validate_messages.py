"""The messages of an episode as they come by in file order: numbers, times, and whole frames."""

from array import array
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import UInt64

from dnet.datasets.reader import DEPTH, FRAME, FRAME_TOPICS, MASK
from dnet.tools.validate_findings import Findings, Severity
from dnet.tools.validate_values import ValueChecks

_TIMED = (*FRAME_TOPICS, DEPTH, MASK)


@dataclass(slots=True)
class _Topic:
    """What is known of the messages of a topic so far."""

    count: int = 0
    sequence: int = 0
    """What the next one should have."""
    last: int = 0
    """Log time of the last one, in nanoseconds."""
    times: "array[int]" = field(default_factory=lambda: array("Q"))
    """Of all of them, for topics that go with each other."""


class MessageChecks:
    """Checks that take the messages of one episode in file order.

    Args:
        findings: Takes what is wrong with them.
    """

    def __init__(self, findings: Findings) -> None:
        self._findings = findings
        self._values = ValueChecks(findings)
        self._topics: dict[str, _Topic] = {}

    def count(self, topic: str) -> int:
        """Return how many messages of a topic there were."""
        return self._topics[topic].count if topic in self._topics else 0

    def take(self, topic: str, sequence: int, time: int, content: memoryview) -> None:
        """Check a message.

        Args:
            topic: Of its channel.
            sequence: Its number within the topic, as it says.
            time: Its log time in nanoseconds.
            content: What is in it.
        """
        state = self._topics.setdefault(topic, _Topic())
        number = state.count
        if sequence != state.sequence:
            self._findings.warn(
                "sequence",
                f"{topic} {number} has sequence number {sequence}, should have {state.sequence}",
            )
        if time < state.last:
            self._findings.error(
                "time-order",
                f"{topic} {number} is from {time} ns, the one before it from {state.last} ns",
            )
        if topic in _TIMED:
            state.times.append(time)
        state.count, state.sequence, state.last = number + 1, sequence + 1, time
        self._values.take(topic, number, time=time, content=content)

    def finish(self, *, finished: bool, points: int | None) -> None:
        """Check what only all messages together tell.

        Args:
            finished: Whether the recording ended by itself; else its last frame may be half.
            points: Points that each cloud should have, if the settings say so.
        """
        severity: Severity = "error" if finished else "warning"
        stamps = self._times(FRAME)
        if not len(stamps):
            self._findings.warn("frame-count", "there is no frame")
        for topic in FRAME_TOPICS:
            times = self._times(topic)
            if len(times) != len(stamps):
                self._findings.add(
                    severity,
                    "frame-count",
                    f"{topic} has {len(times)} messages, there are {len(stamps)} frames",
                )
            both = min(len(times), len(stamps))
            others = np.flatnonzero(times[:both] != stamps[:both])
            if len(others):
                index = int(others[0])
                self._findings.error(
                    "frame-time",
                    f"{topic} {index} is from {times[index]} ns, its frame from {stamps[index]} ns",
                )
        self._check_images(stamps, severity)
        first = self._values.points
        if points is not None and first is not None and first != points:
            self._findings.error("points", f"{first} in a cloud, the settings say {points}")

    def _times(self, topic: str) -> UInt64[np.ndarray, "_"]:
        times = self._topics[topic].times if topic in self._topics else ()
        return np.array(times, np.uint64)

    def _check_images(self, stamps: UInt64[np.ndarray, "_"], severity: Severity) -> None:
        depths, masks = self._times(DEPTH), self._times(MASK)
        if not np.array_equal(depths, masks):
            self._findings.add(
                severity,
                "images",
                f"{len(depths)} depths do not go with {len(masks)} masks, one by one",
            )
        elif not np.isin(depths, stamps).all():
            self._findings.add(severity, "images", "there are images of no frame's time")
