"""A file that has its name when it is whole, and not before."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from dnet.errors import Unwritten


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield where to write, beside `path`; it gets that name if the block ends well.

    Nothing else stays, unless the process is killed: then a hidden `.part` does.

    Raises:
        Unwritten: If it cannot be written.
    """
    # Two processes may do this at a time: each writes a file of its own.
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield part
        part.replace(path)
    except Unwritten:
        raise
    except OSError as error:
        why = os.strerror(error.errno) if error.errno else str(error)
        raise Unwritten(path.absolute().parent, f"{path.name}: {why}") from error
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def write_whole(path: Path, content: bytes) -> None:
    """Write `content` into the file `path`, whole or not at all; its folder is made if need be.

    Raises:
        Unwritten: If it cannot be written.
    """
    with whole_file(path) as part:
        part.write_bytes(content)
