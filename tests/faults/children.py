"""The command in a process of its own, for a test to do it harm."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

import pytest

PATIENCE = 240.0
"""Seconds to wait for a sign, on a machine that has much else to do."""
MAIN = "from dnet.cli import main\nif __name__ == '__main__':\n    main()"
OWN_MOUNTS = ("unshare", "--user", "--map-root-user", "--mount")
"""Gives a process file systems of its own, to whoever starts it."""


Child = subprocess.Popen[bytes]


def begin(*words: object, log: Path) -> Child:
    """Start `dnet WORDS` in a process group of its own; what it says goes into `log`."""
    with log.open("w") as told:
        return subprocess.Popen(
            [sys.executable, "-c", MAIN, *map(str, words)],
            stdout=told,
            stderr=told,
            start_new_session=True,
            env={**os.environ, "OMP_NUM_THREADS": "1"},
        )


def killed(*words: object, log: Path, at: Callable[[int], bool]) -> None:
    """Start `dnet WORDS` and kill it, and all that it started, as soon as `at` holds of it."""
    process = begin(*words, log=log)
    try:
        wait_until(lambda: at(process.pid), process, log)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        status = process.wait()
    assert status == -signal.SIGKILL, "it ended before it could be killed"


def wait_until(holds: Callable[[], bool], process: Child, log: Path) -> None:
    """Wait until something holds while a process is alive."""
    deadline = time.monotonic() + PATIENCE
    while not holds():
        assert process.poll() is None, f"it ended too early: {log.read_text()}"
        assert time.monotonic() < deadline, f"no sign: {log.read_text()}"
        time.sleep(0.001)


def elsewhere(
    function: Callable[..., None],
    *arguments: object,
    mount: str = "",
    environment: Mapping[str, str] | None = None,
) -> None:
    """Call a function of a test module in a process of its own, which must end well.

    Args:
        function: What to call, by module and name.
        arguments: For it, as texts.
        mount: What the shell does first, where it may mount what it likes and nobody else sees it.
        environment: What is set there besides.
    """
    call = (
        f"from {function.__module__} import {function.__name__} as called; import sys, json\n"
        "if __name__ == '__main__':\n"
        "    called(*json.loads(sys.argv[1]))"
    )
    words = [sys.executable, "-c", call, json.dumps([str(one) for one in arguments])]
    if mount:
        if not _may_mount():
            pytest.skip("this machine lets no user mount a file system of his own (unshare)")
        words = [*OWN_MOUNTS, "sh", "-ec", f'{mount}\nexec "$@"', "sh", *words]
    ran = subprocess.run(
        words,
        capture_output=True,
        text=True,
        check=False,
        timeout=PATIENCE,
        env={**os.environ, "OMP_NUM_THREADS": "1", **(environment or {})},
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr


def _may_mount() -> bool:
    try:
        tried = subprocess.run([*OWN_MOUNTS, "true"], capture_output=True, check=False)
    except FileNotFoundError:
        return False
    return tried.returncode == 0
