"""A dataset in an object store: episodes are recorded on this machine and uploaded when whole."""

import shutil
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir
from threading import Thread
from time import sleep
from typing import Any, TypeVar

from dnet.datasets.sources import said
from dnet.datasets.stores import S3, file_system
from dnet.errors import NoSpace, StoreFailed, TooLarge, UnknownStore
from dnet.files.sizes import LARGEST_JSON

BUCKETS = (*S3, "gs", "gcs", "abfs", "abfss", "az")
"""Stores in which a folder is but the beginning of a name; to make one could make a bucket."""
LASTING = (FileNotFoundError, PermissionError, NotImplementedError)
"""Failures that do not pass: no such bucket, no leave to write, a store to read from only."""

SLOWEST = 50_000
"""Bytes that at least go to a store in a second."""

_Value = TypeVar("_Value")


@dataclass(frozen=True)
class RemoteStore:
    """Files of any store that fsspec can write to, by URL.

    Addresses and credentials come from where the store's own tools have them: for S3, the
    environment (`AWS_ACCESS_KEY_ID`, `AWS_ENDPOINT_URL`) or `~/.aws`.

    There is no lock. Two recordings of the same request in one place write the same bytes; the
    manifest of one may lack episodes of the other, which the next call records again.

    Raises:
        UnknownStore: If fsspec knows no such store.
        MissingExtra: If what it takes is not installed.
    """

    name: str
    """Its URL, without a slash at the end."""
    pauses: tuple[float, ...] = (1.0, 5.0, 25.0)
    """Seconds before each further try to write, besides the tries of the store's own client."""

    patience: float = 120.0
    """Seconds for each try, and `SLOWEST` for what is sent: clients may wait for ever for the word
    to go on."""

    def __post_init__(self) -> None:
        """Refuse what is no store before anything is recorded."""
        if not self._place[1].strip("/"):
            raise UnknownStore(self.name, "it names no folder or bucket")

    @property
    def folder(self) -> None:
        """Nowhere on this machine."""

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Make the folder, where a store has such a thing; nobody is kept out.

        Raises:
            StoreFailed: If it cannot be made.
        """
        files, path = self._place
        if self.name.partition("://")[0] not in BUCKETS:
            self._insist(lambda: files.makedirs(path, exist_ok=True))
        yield

    def check_room(self, episodes: int, *, episode_bytes: int) -> None:
        """Refuse to begin an episode without room for it on this machine's disk.

        Raises:
            NoSpace: If not even one of `episode_bytes` fits.
        """
        scratch = gettempdir()
        free = shutil.disk_usage(scratch).free
        if episodes and episode_bytes > free:
            raise NoSpace(f"the scratch folder {scratch} (TMPDIR)", episode_bytes, free)

    def sizes(self) -> dict[str, int]:
        """Return the bytes of each file, by name.

        Raises:
            StoreFailed: If the store does not answer.
        """
        files, path = self._place
        files.invalidate_cache()
        try:
            found = files.ls(path, detail=True)
        except FileNotFoundError:
            return {}
        except Exception as error:
            raise StoreFailed(self.name, said(error)) from error
        return {Path(one["name"]).name: one["size"] for one in found if one["type"] == "file"}

    def read(self, name: str) -> bytes:
        """Return the content of a file.

        Raises:
            StoreFailed: If there is none, or the store does not answer.
            TooLarge: If it is larger than the manifest of any recording.
        """
        files, path = self._place
        try:
            size = files.info(f"{path}/{name}")["size"]
            if size > LARGEST_JSON:
                raise TooLarge("file", f"{self.name}/{name}", size, LARGEST_JSON)
            content: bytes = files.cat_file(f"{path}/{name}")
        except TooLarge:
            raise
        except Exception as error:
            raise StoreFailed(self.name, said(error)) from error
        return content

    def write(self, name: str, content: bytes) -> None:
        """Write a file as a whole.

        Raises:
            StoreFailed: If no try succeeds.
        """
        files, path = self._place
        self._insist(lambda: files.pipe_file(f"{path}/{name}", content), size=len(content))

    def append(self, name: str, line: str) -> None:
        """Add a line to a file by writing all of it anew: a store's files do not grow.

        Raises:
            StoreFailed: If it cannot be read or written.
        """
        files, path = self._place

        def rewrite() -> None:
            try:
                old = files.cat_file(f"{path}/{name}")
            except FileNotFoundError:
                old = b""
            files.pipe_file(f"{path}/{name}", old + f"{line}\n".encode())

        self._insist(rewrite)

    @contextmanager
    def scratch(self, episode_bytes: int) -> Iterator[Path]:
        """Return a folder of this machine to record an episode in, gone afterwards.

        A process that is killed leaves it in the system's folder for such things.

        Raises:
            NoSpace: If it has no room for `episode_bytes`.
        """
        self.check_room(1, episode_bytes=episode_bytes)
        with TemporaryDirectory(prefix="dnet-") as scratch:
            yield Path(scratch)

    def keep(self, path: Path) -> None:
        """Upload a finished episode, see that all of it came, and remove it here.

        Raises:
            StoreFailed: If no try succeeds.
        """
        files, place = self._place
        name, size = f"{place}/{path.name}", path.stat().st_size

        def upload() -> None:
            files.put_file(str(path), name)
            arrived = files.info(name)["size"]
            if arrived != size:
                raise OSError(f"{arrived} of {size} bytes of {path.name} arrived")

        self._insist(upload, size=size)
        path.unlink()

    @property
    def _place(self) -> tuple[Any, str]:
        """The store's fsspec file system, which fsspec keeps for each process, and our path."""
        return file_system(self.name, doing="writing to")

    def _insist(self, action: Callable[[], _Value], *, size: int = 0) -> _Value:
        """Do what may fail for a while, again after each pause, or may never come to an end."""
        pauses, seconds = iter(self.pauses), self.patience + size / SLOWEST
        while True:
            try:
                return _within(seconds, action)
            # Stores raise what they like: botocore's errors are not even OSErrors.
            except Exception as error:
                pause = None if isinstance(error, LASTING) else next(pauses, None)
                if pause is None:
                    raise StoreFailed(self.name, said(error)) from error
            sleep(pause)


def _within(seconds: float, action: Callable[[], _Value]) -> _Value:
    """Return what an action returns, or leave it behind when its time is over.

    Raises:
        TimeoutError: If it is not done by then.
        Exception: What it raises.
    """
    done: Future[_Value] = Future()

    def act() -> None:
        try:
            done.set_result(action())
        except BaseException as error:
            done.set_exception(error)

    Thread(target=act, daemon=True).start()
    try:
        return done.result(seconds)
    except TimeoutError as error:
        if done.done():
            raise
        raise TimeoutError(f"no answer within {seconds:.0f} s") from error
