"""Rerun streams that leave nothing behind in a process which opens many, one after another."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb
import rerun_bindings

from dnet.errors import Unwritten


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
def writing_to(path: Path) -> Iterator[None]:
    """Say of a file that Rerun cannot write that it takes no more: it does not know an `OSError`.

    Raises:
        Unwritten: Instead of the error of Rerun.
    """
    try:
        yield
    except RuntimeError as error:
        raise Unwritten(path.parent, f"{path.name} takes no more ({error})") from error


def save_stream(stream: rr.RecordingStream, path: Path, *, blueprint: rrb.Blueprint | None) -> None:
    """Write what is logged from now on to a file, with a layout for the application.

    Raises:
        Unwritten: If the file takes nothing.
    """
    with _in_memory(blueprint, rr.get_application_id(stream)) as layout, writing_to(path):
        rerun_bindings.save(str(path), layout, stream.to_native())


def close_stream(stream: rr.RecordingStream, path: Path) -> None:
    """Bring everything that was logged to its file, and close it.

    Raises:
        Unwritten: If the file did not take it.
    """
    try:
        with writing_to(path):
            stream.flush()
    finally:
        stream.disconnect()


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
