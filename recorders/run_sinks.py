"""Where the Rerun recording of a run goes: to its file, and perhaps to a window as well."""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from dnet.errors import NoLiveView, Unwritten
from dnet.recorders.live_view import LiveView
from dnet.recorders.streams import send_stream

PATIENCE_SECONDS = 3.0
"""How long a window may take to accept what it is sent, before the run goes on without it."""
LOST = "the live view is gone; the run goes on, and its files miss nothing"

OpenView = Callable[[], LiveView]


class RunSinks:
    """Sends a recording to a file, and to a window as long as there is one.

    The file never waits for the window for long: one that was closed, hangs, or could not be
    opened is done without, which is said in a line.

    Args:
        recording: What is sent.
        part: The file.
        blueprint: The layout.
        view: Opens a window; None for no window.
        say: Shows a line to people.
    """

    def __init__(
        self,
        recording: rr.RecordingStream,
        part: Path,
        *,
        blueprint: rrb.Blueprint,
        view: OpenView | None,
        say: Callable[[str], None],
    ) -> None:
        self._recording, self._part, self._say = recording, part, say
        self._view: LiveView | None = None
        self._lost = False
        file = rr.FileSink(part)
        if view is not None:
            try:
                self._view = view()
            except NoLiveView as error:
                say(str(error))
        window = [] if self._view is None else [rr.GrpcSink(self._view.address)]
        with _writing(part):
            # The file comes first: it is flushed whatever becomes of the window.
            send_stream(recording, file, *window, blueprint=blueprint)

    def flush(self) -> None:
        """Bring everything to the file, and to the window."""
        if self._view is None:
            self._flush_file()
            return
        try:
            self._recording.flush(timeout_sec=PATIENCE_SECONDS)
        except RuntimeError:
            self._lose(self._view)
            self._flush_file()

    def close(self) -> None:
        """Bring everything to the file and close it; the window stays open."""
        self.flush()
        if self._view is None:
            self._recording.disconnect()
            return
        # Disconnecting waits for the window without a limit: one that hangs by now is ended.
        closing = threading.Thread(target=self._recording.disconnect, daemon=True)
        closing.start()
        closing.join(PATIENCE_SECONDS)
        if closing.is_alive():
            self._lose(self._view)
            closing.join(PATIENCE_SECONDS)
        if closing.is_alive():
            # The file is closed already, and Rerun would wait once more at the process's end.
            rr.unregister_shutdown()

    def _flush_file(self) -> None:
        with _writing(self._part):
            try:
                self._recording.flush()
            except RuntimeError as error:
                # Rerun goes on to complain of a connection that is lost.
                if not (self._lost and "gRPC" in str(error)):
                    raise

    def _lose(self, view: LiveView) -> None:
        # What hangs is ended: the connection breaks, and nothing waits for it any longer.
        view.end()
        self._view, self._lost = None, True
        self._say(LOST)


@contextmanager
def _writing(part: Path) -> Iterator[None]:
    try:
        yield
    except RuntimeError as error:
        raise Unwritten(part.parent, f"{part.name}: {error}") from error
