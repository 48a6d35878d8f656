"""The Rerun viewer at the end of a command: in a window, or without a screen for one picture."""

import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

from rerun.experimental import ViewerClient, ViewerState

from dnet.errors import NoPicture, ViewerFailed
from dnet.files.whole_file import write_whole
from dnet.recorders.rerun_scene import TIME_TIMELINE
from dnet.recorders.viewer_process import (
    LOCAL,
    QUIET,
    Viewer,
    check_screen,
    command,
    free_port,
    running,
)

T = TypeVar("T")

WINDOW = "1600x900"
TRIES = 3
START_SECONDS = 20.0
DRAW_SECONDS = 30.0
NOTICE_SECONDS = 5.0
"""The viewer covers its upper right corner with notices for about four seconds."""
POLL_SECONDS = 0.25


def show(files: Sequence[Path]) -> None:
    """Open `files` in a window and wait until it is closed.

    Raises:
        NoScreen: If there is no screen to open it on.
        ViewerFailed: If the viewer ends by an error.
    """
    check_screen()
    with running(command("--port", "auto", *map(str, files)), None, QUIET) as viewer:
        status = viewer.wait()
    if status:
        raise ViewerFailed(status)


def draw(file: Path, picture: Path, *, seconds: float | None) -> None:
    """Draw `file` as it stands at `seconds` of simulation, or at its end, into `picture`.

    Raises:
        NoPicture: If the viewer cannot draw on this machine.
    """

    def once() -> bytes:
        with _opened(file, WINDOW) as (client, state, started):
            _stop_at(client, _last_time(state) if seconds is None else seconds)
            client.run_command("ui.toggle_top_panel")
            return _settled_picture(client, started)

    content = _tried(once, picture)
    write_whole(picture, content)


def draw_view(
    file: Path,
    times: Sequence[float],
    *,
    window: str,
    on_picture: Callable[[int], None] = lambda _: None,
) -> list[bytes]:
    """Return the first view of `file` as PNGs, at each of `times` in seconds of simulation.

    Args:
        file: A Rerun recording.
        times: When.
        window: Size of the viewer that the view is in, as in "800x600".
        on_picture: Is told how many pictures there are.

    Raises:
        NoPicture: If the viewer cannot draw on this machine.
    """

    def all_of_them() -> list[bytes]:
        with _opened(file, window) as (client, state, started):
            pictures: list[bytes] = []
            for time_ in times:
                _stop_at(client, time_)
                pictures.append(_settled_picture(client, started, view=state.views[0].view_id))
                on_picture(len(pictures))
            return pictures

    return _tried(all_of_them, file)


def _tried(drawn: Callable[[], T], what: Path) -> T:
    """Return what the viewer has drawn; try it again if the viewer fails, as it does under load."""
    why = ""
    for _ in range(TRIES):
        try:
            return drawn()
        except (ConnectionError, RuntimeError, TimeoutError) as error:
            why = " ".join(str(error).split())[:300]
    raise NoPicture(what, TRIES, why)


@contextmanager
def _opened(file: Path, window: str) -> Iterator[tuple[ViewerClient, ViewerState, float]]:
    """Open `file` in a viewer without a screen; yield that, what it shows, and since when."""
    port = free_port()
    headless = command("--headless", "--port", str(port), "--hide-welcome-screen")
    headless += ["--window-size", window, str(file)]
    with tempfile.TemporaryDirectory() as directory:
        log = Path(directory) / "viewer.log"
        environment = {"XDG_RUNTIME_DIR": directory, **QUIET}
        with log.open("wb") as output, running(headless, output.fileno(), environment) as viewer:
            started = time.monotonic()
            try:
                client, state = _loaded(f"rerun+http://{LOCAL}:{port}/proxy", viewer)
                yield client, state, started
            except (ConnectionError, RuntimeError, TimeoutError) as error:
                if viewer.poll() is not None:
                    said = log.read_text(errors="replace").strip().splitlines()[-1:]
                    raise RuntimeError(f"the viewer ended: {' '.join(said)}") from error
                raise


def _loaded(url: str, viewer: Viewer) -> tuple[ViewerClient, ViewerState]:
    """Wait until the viewer shows the whole recording."""
    deadline = time.monotonic() + START_SECONDS
    error: Exception | None = None
    while time.monotonic() < deadline and viewer.poll() is None:
        try:
            client = ViewerClient.connect(url)
            state = client.get_state()
            # A viewer without a window works only when it is asked for a frame.
            client.take_screenshot(max_size=64)
        except (ConnectionError, RuntimeError) as refused:
            error = refused
        else:
            if state.active_recording and not state.loading and state.views:
                return client, state
        time.sleep(POLL_SECONDS)
    raise TimeoutError(f"no recording on screen after {START_SECONDS:.0f} s") from error


def _stop_at(client: ViewerClient, seconds: float | None) -> None:
    """Stop the recording at `seconds`; one without simulation time stays where it is."""
    if seconds is not None:
        client.set_time(TIME_TIMELINE, duration=seconds, play_state="paused")


def _last_time(state: ViewerState) -> float | None:
    """Return the end of the simulation's timeline, or None if the recording has none."""
    ends = [
        timeline.end
        for recording in state.recordings
        for timeline in recording.timelines
        if timeline.name == TIME_TIMELINE and timeline.end is not None
    ]
    return max(ends) / 1e9 if ends else None


def _settled_picture(client: ViewerClient, started: float, *, view: str | None = None) -> bytes:
    """Return a picture that no longer changes, taken after the viewer's notices are gone."""
    deadline = time.monotonic() + DRAW_SECONDS
    before = b""
    while True:
        picture = client.take_screenshot(view)
        late = time.monotonic()
        if late > deadline or (late - started > NOTICE_SECONDS and picture == before):
            return picture
        before = picture
        time.sleep(POLL_SECONDS)
