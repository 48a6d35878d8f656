"""A window of the Rerun viewer that a run is shown in while it goes on, and that may go away."""

import socket
import tempfile
import time
from typing import IO

from dnet.errors import NoLiveView, NoScreen
from dnet.recorders import viewer_process
from dnet.recorders.viewer_process import LOCAL, QUIET, Viewer

START_SECONDS = 30.0
"""How long a viewer may take until it listens."""
POLL_SECONDS = 0.05


class LiveView:
    """Opens a window, which stays open when the run is over: it belongs to who looks at it.

    Raises:
        NoLiveView: If there is no screen, or the viewer cannot be started.
    """

    address: str
    """Where the viewer listens."""

    def __init__(self) -> None:
        port = viewer_process.free_port()
        self.address = f"rerun+http://{LOCAL}:{port}/proxy"
        with tempfile.TemporaryFile() as said:
            try:
                viewer_process.check_screen()
            except NoScreen as error:
                raise NoLiveView("there is no screen to open a window on") from error
            command = viewer_process.command("--port", str(port), "--hide-welcome-screen")
            self._viewer: Viewer = viewer_process.start(command, said.fileno(), QUIET)
            try:
                self._wait(port, said)
            except BaseException:
                self.end()
                raise

    def end(self) -> None:
        """End the viewer, if it has not come to an end yet."""
        viewer_process.end(self._viewer)

    def _wait(self, port: int, said: IO[bytes]) -> None:
        """Wait until the viewer listens."""
        deadline = time.monotonic() + START_SECONDS
        while not _listens(port):
            status = self._viewer.poll()
            if status is not None:
                raise NoLiveView(f"the viewer ended with status {status}: {_last_words(said)}")
            if time.monotonic() > deadline:
                raise NoLiveView(f"the viewer was not ready within {START_SECONDS:.0f} s")
            time.sleep(POLL_SECONDS)


def _listens(port: int) -> bool:
    try:
        with socket.create_connection((LOCAL, port), timeout=1.0):
            return True
    except OSError:
        return False


def _last_words(said: IO[bytes]) -> str:
    said.seek(0)
    lines = said.read().decode(errors="replace").strip().splitlines()
    return lines[-1].strip() if lines else "it said nothing"
