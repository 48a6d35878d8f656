"""The file or folder of an export: it has its name when it is whole, and not before."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from dnet.errors import DnetError, OccupiedOutput, Unwritten


@dataclass(frozen=True, slots=True)
class Exported:
    """What an export wrote."""

    out: Path
    """The file or folder."""
    episodes: int
    frames: int

    @property
    def bytes(self) -> int:
        """Length of the file, or of all files in the folder."""
        files = [self.out] if self.out.is_file() else self.out.rglob("*")
        return sum(path.stat().st_size for path in files if path.is_file())


@contextmanager
def finished_output(out: Path) -> Iterator[Path]:
    """Yield where to write, `out` + ".part"; it gets its name if the block ends well.

    After an error or Ctrl-C nothing of it stays.

    Raises:
        OccupiedOutput: If `out`, or an unfinished one of that name, is already there.
        Unwritten: If it cannot be written.
    """
    part = Path(f"{out.absolute()}.part")
    _refuse_occupied(out)
    if part.exists():
        raise OccupiedOutput(part, "an unfinished export")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        yield part
        _refuse_occupied(out)
        part.rename(out)
    except DnetError:
        raise
    except OSError as error:
        # Libraries put paragraphs into their errors: the number says it in a few words.
        why = os.strerror(error.errno) if error.errno else str(error)
        raise Unwritten(out.absolute().parent, why) from error
    finally:
        if part.is_dir():
            shutil.rmtree(part, ignore_errors=True)
        else:
            with suppress(OSError):
                part.unlink()


def _refuse_occupied(out: Path) -> None:
    if out.exists():
        raise OccupiedOutput(out, "a folder" if out.is_dir() else "a file")
