"""A Rerun recording that is made at once, and takes the place of an older one when it is whole."""

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from dnet.recorders.streams import open_stream, saved_stream


@contextmanager
def recording_file(
    path: Path, *, application: str, name: str, blueprint: rrb.Blueprint
) -> Iterator[rr.RecordingStream]:
    """Give a recording to log to, which is then found at `path`; of an exception, nothing stays.

    Whoever opens `path` finds a whole recording. The same name at the same place always has the
    same recording id: a viewer that opens it again adds what is new.

    Args:
        path: Where the recording goes, an `.rrd`.
        application: Of which all recordings are shown in one layout.
        name: What the viewer calls it.
        blueprint: The layout.

    Raises:
        Unwritten: If it cannot be written.
    """
    recording = open_stream(
        application,
        recording_id=hashlib.sha256(f"{name}\n{path.resolve()}".encode()).hexdigest()[:32],
        # They would tell when the file was written.
        properties=False,
    )
    recording.set_log_time_enabled(False)
    with saved_stream(recording, path, blueprint=blueprint):
        recording.send_recording_name(name)
        yield recording
