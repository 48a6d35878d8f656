"""Where the arms' links stand, as Rerun takes it: all of them are rows of one entity.

Rerun allows any number of frames on an entity; one entity for each would cost thirty times as much.
"""

from collections.abc import Iterable, Sequence

import numpy as np
import rerun as rr
from jaxtyping import Float64

from dnet.types import LinkWay, Transform

LINKS = "tf"
WORLD = "world"


def framed(place: str, frame: str) -> str:
    """Return what a frame of the scene at `place` is called; all scenes stand in one world."""
    return frame if not place or frame == WORLD else f"{place}.{frame}"


def placed(place: str, entity: str) -> str:
    """Return where an entity of the scene at `place` hangs."""
    return f"{place}/{entity}" if place else entity


def time_column(timeline: str, seconds: Float64[np.ndarray, "_"]) -> rr.TimeColumn:
    """Return times as Rerun rounds those of single values."""
    nanoseconds = np.rint(1e9 * seconds).astype("timedelta64[ns]")
    return rr.TimeColumn(timeline, duration=nanoseconds)


class LinkRows:
    """Sends links to a scene.

    Args:
        recording: The stream to send to.
        place: Where the entities of the scene hang.
    """

    def __init__(self, recording: rr.RecordingStream, *, place: str) -> None:
        self._recording, self._place = recording, place
        self._known: dict[tuple[tuple[str, str], ...], list[rr.ComponentColumn]] = {}

    def send(self, entries: Sequence[Transform], indexes: Iterable[rr.TimeColumn]) -> None:
        """Send links of any number of frames.

        Args:
            entries: Frame by frame.
            indexes: When they stood there: columns as long as `entries`.
        """
        if entries:
            self._send(
                [(entry.parent, entry.child) for entry in entries],
                np.stack([entry.translation for entry in entries]),
                np.stack([entry.rotation for entry in entries]),
                indexes,
            )

    def send_way(self, way: LinkWay, indexes: Iterable[rr.TimeColumn]) -> None:
        """Send the same links at several times; `indexes` has each time once for each link."""
        self._send(
            [*way.names] * len(way.translations),
            way.translations.reshape(-1, 3),
            way.rotations.reshape(-1, 4),
            indexes,
        )

    def _send(
        self,
        names: Sequence[tuple[str, str]],
        translations: Float64[np.ndarray, "n 3"],
        rotations: Float64[np.ndarray, "n 4"],
        indexes: Iterable[rr.TimeColumn],
    ) -> None:
        poses = rr.Transform3D.columns(translation=translations, quaternion=rotations)
        self._recording.send_columns(
            placed(self._place, LINKS), indexes=indexes, columns=[*poses, *self._named(names)]
        )

    def _named(self, names: Sequence[tuple[str, str]]) -> list[rr.ComponentColumn]:
        """Return the columns of names, which come again and again."""
        key = tuple(names)
        if key not in self._known:
            columns = rr.Transform3D.columns(
                parent_frame=[framed(self._place, parent) for parent, _ in names],
                child_frame=[framed(self._place, child) for _, child in names],
            )
            self._known[key] = list(columns)
        return self._known[key]
