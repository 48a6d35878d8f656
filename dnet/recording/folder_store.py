"""A dataset in a folder: episodes are written in place and get their name when they are whole."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from filelock import FileLock, Timeout

from dnet.errors import NoSpace, OccupiedOutput, OutputInUse, StoreFailed, TooLarge
from dnet.files.sizes import LARGEST_JSON, read_at_most

LOCK = ".recording.lock"
APART = ".recording-"


@dataclass(frozen=True)
class FolderStore:
    """Files in a folder of this machine, or of a file system that several machines share."""

    folder: Path
    in_place: bool = True
    """Whether an episode in the making is seen as `.part`, and stays if the recording stops; or
    is in a hidden folder of its own."""

    @property
    def name(self) -> str:
        """The folder's path."""
        return str(self.folder)

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Make the folder if need be, and lock it.

        Raises:
            OccupiedOutput: If it is a file.
            OutputInUse: If another process records there.
            StoreFailed: If it cannot be written to.
        """
        if self.folder.exists() and not self.folder.is_dir():
            raise OccupiedOutput(self.folder, "a file")
        lock = FileLock(self.folder / LOCK, blocking=False)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            lock.acquire()
        except Timeout as error:
            raise OutputInUse(self.folder) from error
        except OSError as error:
            raise StoreFailed(self.name, str(error)) from error
        try:
            for left in self.folder.glob(f"{APART}*/"):
                shutil.rmtree(left, ignore_errors=True)
            yield
        finally:
            lock.release()

    def check_room(self, episodes: int, *, episode_bytes: int) -> None:
        """Refuse what the disk has no room for.

        Raises:
            NoSpace: If `episodes` of `episode_bytes` each do not fit.
        """
        need, free = episodes * episode_bytes, shutil.disk_usage(self.folder).free
        if need > free:
            raise NoSpace(self.folder, need, free)

    def sizes(self) -> dict[str, int]:
        """Return the bytes of each file, by name; none where there is no folder."""
        if not self.folder.exists():
            return {}
        with os.scandir(self.folder) as found:
            return {entry.name: entry.stat().st_size for entry in found if entry.is_file()}

    def read(self, name: str) -> bytes:
        """Return the content of a file.

        Raises:
            StoreFailed: If it cannot be read.
            TooLarge: If it is larger than the manifest of any recording.
        """
        try:
            return read_at_most(self.folder / name, LARGEST_JSON, what="file")
        except TooLarge:
            raise
        except OSError as error:
            raise StoreFailed(self.name, str(error)) from error

    def write(self, name: str, content: bytes) -> None:
        """Write a file beside itself and give it its name when it is on the disk."""
        part = self.folder / f"{name}.part"
        with part.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        part.replace(self.folder / name)

    def append(self, name: str, line: str) -> None:
        """Add a line to a file."""
        with (self.folder / name).open("a") as file:
            file.write(f"{line}\n")

    @contextmanager
    def scratch(self, episode_bytes: int) -> Iterator[Path]:  # noqa: ARG002  # checked at the start
        """Return where to record an episode: the folder itself, or one hidden in it."""
        if self.in_place:
            yield self.folder
        else:
            with TemporaryDirectory(prefix=APART, dir=self.folder) as apart:
                yield Path(apart)

    def keep(self, path: Path) -> None:
        """Move an episode to where the others are, if it is not there already."""
        path.replace(self.folder / path.name)
