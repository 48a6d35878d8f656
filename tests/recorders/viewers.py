"""Programs in the place of the Rerun viewer, and whether they still run."""

import os
import time
from pathlib import Path


def stand_in(path: Path, script: str) -> Path:
    """Write a program to run in the viewer's place, which its launcher allows."""
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    return path


def alive(process: int) -> bool:
    """Return whether a process runs; one that ended and waits to be collected does not."""
    try:
        os.kill(process, 0)
        state = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0]
    except (ProcessLookupError, FileNotFoundError):
        return False
    return state != "Z"


def ends(process: int, *, within: float = 20.0) -> bool:
    """Wait for a process to end; return whether it did."""
    deadline = time.monotonic() + within
    while alive(process) and time.monotonic() < deadline:
        time.sleep(0.01)
    return not alive(process)
