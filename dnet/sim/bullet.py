"""PyBullet, without what it prints from C and what it would keep of every file that it reads."""

import ctypes
import os
from collections.abc import Iterator
from contextlib import contextmanager

from dnet.packages import needed_for


@contextmanager
def quiet() -> Iterator[None]:
    """Send what C code prints on stdout and stderr nowhere."""
    kept = [(stream, os.dup(stream)) for stream in (1, 2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for stream, _ in kept:
            os.dup2(nowhere, stream)
        yield
    finally:
        # C keeps what it prints into a file or a pipe until there is more of it, or the end.
        if os.name == "posix":
            ctypes.CDLL(None).fflush(None)
        for stream, copy in kept:
            os.dup2(copy, stream)
            os.close(copy)
        os.close(nowhere)


with needed_for("the simulation"), quiet():
    import pybullet

__all__ = ["pybullet", "quiet", "start_server"]


def start_server() -> int:
    """Start a Bullet server in this process, and return its number.

    Bullet keeps every mesh that it reads from an .obj, by the name of the file, until the process
    ends. Ours are each in a file of its own, read once: kept, they would be a leak, so that is
    turned off, for the whole process.
    """
    client: int = pybullet.connect(pybullet.DIRECT)
    pybullet.setPhysicsEngineParameter(enableFileCaching=0, physicsClientId=client)
    return client
