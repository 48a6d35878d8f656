"""One writer to a directory: a second one is told, and a dead one keeps nobody out."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from dnet.errors import OccupiedOutput, OutputInUse, Unwritten

LOCK = ".writer.lock"


@contextmanager
def one_writer(folder: Path) -> Iterator[None]:
    """Keep other processes from writing a result into `folder`, which is made if need be.

    The system lets go of the lock when the process ends, however it does. A folder that was made
    for nothing is gone again.

    Raises:
        OccupiedOutput: If `folder` is a file.
        OutputInUse: If another process writes there.
        Unwritten: If it cannot be written to.
    """
    if folder.exists() and not folder.is_dir():
        raise OccupiedOutput(folder, "a file")
    made, file = not folder.exists(), folder / LOCK
    lock = FileLock(file, blocking=False)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock.acquire()
    except Timeout as error:
        raise OutputInUse(folder) from error
    except OSError as error:
        raise Unwritten(folder, error.strerror or str(error)) from error
    try:
        yield
    finally:
        # While it is held: whoever waits for a file that is gone looks for it anew.
        with suppress(OSError):
            file.unlink()
        lock.release()
        if made:
            with suppress(OSError):
                folder.rmdir()
