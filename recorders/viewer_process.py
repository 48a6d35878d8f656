"""The Rerun viewer as a child process: how it is started, and how all of it is ended."""

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

from dnet.errors import NoScreen

RERUN = (
    sys.executable,
    "-c",
    # `python -m rerun_cli` would lose the status.
    "import sys; from rerun_cli.__main__ import main; sys.exit(main())",
)
"""The command line of Rerun that belongs to this Python, wherever the PATH leads."""
LOCAL = "127.0.0.1"
"""The viewer listens on every interface unless told otherwise."""
QUIET: Mapping[str, str] = {"RERUN_APP_ONLY": "true"}
"""The viewer is part of a command: it is not to ask about statistics in its output."""

Viewer = subprocess.Popen[bytes]


def command(*arguments: str) -> list[str]:
    """Return the command line of a viewer that listens to this machine alone."""
    return [*RERUN, "--bind", LOCAL, *arguments]


def check_screen() -> None:
    """Check that there is a screen for a window.

    Raises:
        NoScreen: If there is none.
    """
    screens = ("DISPLAY", "WAYLAND_DISPLAY")
    if sys.platform.startswith("linux") and not any(os.environ.get(name) for name in screens):
        raise NoScreen


def start(command: Sequence[str], output: int | None, environment: Mapping[str, str]) -> Viewer:
    """Start the viewer in a process group of its own, which Ctrl-C here does not reach."""
    return subprocess.Popen(
        command,
        env={**os.environ, **environment},
        stdin=subprocess.DEVNULL,
        stdout=output,
        stderr=output,
        start_new_session=True,
    )


@contextmanager
def running(
    command: Sequence[str], output: int | None, environment: Mapping[str, str]
) -> Iterator[Viewer]:
    """Run the viewer, and end all of its group."""
    process = start(command, output, environment)
    try:
        yield process
    finally:
        end(process)


def end(process: Viewer) -> None:
    """End the viewer, however stubborn, and its group.

    The command is a Python launcher: ending it alone would leave the viewer behind.
    """
    for sign in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(process.pid, sign)
        except ProcessLookupError:
            break
        try:
            process.wait(timeout=2)
        except subprocess.TimeoutExpired:
            continue
    process.wait()


def free_port() -> int:
    """Return a port of this machine that nothing listens on."""
    with socket.socket() as probe:
        probe.bind((LOCAL, 0))
        port: int = probe.getsockname()[1]
    return port
