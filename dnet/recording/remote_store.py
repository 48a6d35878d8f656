"""A dataset in an object store: episodes are recorded on this machine and uploaded when whole."""

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory, gettempdir
from time import sleep
from typing import Any, TypeVar

from dnet.errors import MissingExtra, NoSpace, StoreFailed, UnknownStore

S3 = ("s3", "s3a")
LASTING = (FileNotFoundError, PermissionError, NotImplementedError)
"""Failures that do not pass: no such bucket, no leave to write there, a store to read from."""

_Value = TypeVar("_Value")


@dataclass(frozen=True)
class RemoteStore:
    """Files of any store that fsspec can write to, by URL.

    Addresses and credentials come from where the store's own tools have them: for S3, the
    environment (`AWS_ACCESS_KEY_ID`, `AWS_ENDPOINT_URL`) or `~/.aws`. There is no lock: two
    recordings of the same request in the same place write the same bytes twice; their manifests
    may then lack episodes, which the next call records again.

    Raises:
        UnknownStore: If fsspec knows no such store.
        MissingExtra: If what it takes is not installed.
    """

    name: str
    """Its URL, without a slash at the end."""
    pauses: tuple[float, ...] = (1.0, 5.0, 25.0)
    """Seconds before each further try of an upload, besides the tries that a store's own client
    makes."""

    def __post_init__(self) -> None:
        """Refuse what is no store before anything is recorded."""
        if not self._place[1].strip("/"):
            raise UnknownStore(self.name, "it names no bucket")

    @property
    def folder(self) -> None:
        """Nowhere on this machine."""

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Make the folder, where a store has such a thing."""
        files, path = self._place
        self._try(lambda: files.makedirs(path, exist_ok=True))
        yield

    def check_room(self, episodes: int, *, episode_bytes: int) -> None:
        """Refuse to begin without room for an episode on this machine's disk.

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
            found = self._try(lambda: files.ls(path, detail=True))
        except FileNotFoundError:
            return {}
        return {Path(one["name"]).name: one["size"] for one in found if one["type"] == "file"}
