"""PyBullet, without what it prints from C: its build time, and the size of every soft body."""

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
        for stream, copy in kept:
            os.dup2(copy, stream)
            os.close(copy)
        os.close(nowhere)


with needed_for("the simulation"), quiet():
    import pybullet

__all__ = ["pybullet", "quiet"]
