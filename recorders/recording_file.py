"""A Rerun recording that is made at once, and takes the place of an older one when it is whole."""

import hashlib
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from dnet.errors import Unwritten
from dnet.recorders.streams import close_stream, open_stream, save_stream

RESERVE = 32_000_000
"""Bytes that must be free for a recording to be begun."""


@contextmanager
def recording_file(
    path: Path, *, application: str, name: str, blueprint: rrb.Blueprint
) -> Iterator[rr.RecordingStream]:
    """Give a recording to log to, which is then found at `path`; of an exception, nothing stays.

    It is written as `path` + ".part" and renamed, so that whoever opens `path` finds a whole
    recording. The same name at the same place always has the same recording id: a viewer that
    opens it again adds what is new.

    Args:
        path: Where the recording goes, an `.rrd`.
        application: Of which all recordings are shown in one layout.
        name: What the viewer calls it.
        blueprint: The layout.

    Raises:
        Unwritten: If the disk is nearly full, or full before the recording is whole.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    _check_room(path.parent)
    part = path.with_name(path.name + ".part")
    recording = open_stream(
        application,
        recording_id=hashlib.sha256(f"{name}\n{path.resolve()}".encode()).hexdigest()[:32],
        # They would tell when the file was written.
        properties=False,
    )
    recording.set_log_time_enabled(False)
    try:
        try:
            save_stream(recording, part, blueprint=blueprint)
            recording.send_recording_name(name)
            yield recording
        finally:
            close_stream(recording, part)
        with part.open("rb") as file:
            os.fsync(file.fileno())
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def _check_room(folder: Path) -> None:
    """Refuse a disk that is nearly full: Rerun would wait there for ever, and say nothing."""
    free = shutil.disk_usage(folder).free
    if free < RESERVE:
        why = f"{free / 1e6:.1f} MB are free, a recording may take {RESERVE / 1e6:.0f} MB"
        raise Unwritten(folder, why)
