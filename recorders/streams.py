"""Rerun streams that leave nothing behind in a process which opens many, one after another."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
import rerun_bindings

from dnet.files.whole_file import write_whole


def open_stream(
    application: str, *, recording_id: str | None = None, properties: bool = True
) -> rr.RecordingStream:
    """Return a new stream, and let go of those that were closed before.

    Rerun keeps two threads and the buffers of every stream until it is asked to look for those
    that nobody refers to; of its own accord it does so only in `rr.init`
    (https://github.com/rerun-io/rerun/issues/2116).

    Args:
        application: Of which all recordings are shown in one layout.
        recording_id: What a viewer tells recordings apart by; a random one, unless given.
        properties: Whether to send when the recording began.
    """
    rerun_bindings.flush_and_cleanup_orphaned_recordings()
    return rr.RecordingStream(application, recording_id=recording_id, send_properties=properties)


@contextmanager
def saved_stream(
    stream: rr.RecordingStream, path: Path, *, blueprint: rrb.Blueprint | None
) -> Iterator[None]:
    """Write what is logged within to a file, with a layout for the application, and close it.

    It is kept in memory until the end: on a full disk Rerun's own writer may wait for ever. Of an
    exception nothing is written.

    Raises:
        Unwritten: If the file cannot be written.
    """
    with _in_memory(blueprint, rr.get_application_id(stream)) as layout:
        logged = stream.memory_recording()
        try:
            if layout is not None:
                rerun_bindings.send_blueprint(layout, recording=stream.to_native())
            yield
            content = logged.drain_as_bytes()
        finally:
            stream.disconnect()
    write_whole(path, content)


def send_stream(
    stream: rr.RecordingStream, *sinks: rr.FileSink | rr.GrpcSink, blueprint: rrb.Blueprint
) -> None:
    """Send what is logged from now on to several places, with a layout for the application."""
    with _in_memory(blueprint, rr.get_application_id(stream)) as layout:
        rerun_bindings.set_sinks([*sinks], layout, stream.to_native())


@contextmanager
def _in_memory(
    blueprint: rrb.Blueprint | None, application: str | None
) -> Iterator[rerun_bindings.PyMemorySinkStorage | None]:
    """Give the messages of a layout.

    `RecordingStream.save(default_blueprint=...)` does the same but never disconnects the stream
    that it makes for the layout, and a connected stream is never let go of.
    """
    if blueprint is None or application is None:
        yield None
        return
    stream = rr.RecordingStream._from_native(
        rerun_bindings.new_blueprint(application, make_default=False, make_thread_default=False)
    )
    stream.set_time("blueprint", sequence=0)
    blueprint._log_to_stream(stream)
    try:
        yield rerun_bindings.memory_recording(stream.to_native())
    finally:
        stream.disconnect()
