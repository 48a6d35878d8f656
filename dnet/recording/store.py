"""Where a dataset lives: a folder, or an object store that fsspec knows."""

from contextlib import AbstractContextManager
from pathlib import Path
from typing import Protocol, runtime_checkable

from dnet.recording.folder_store import FolderStore
from dnet.recording.remote_store import RemoteStore


@runtime_checkable
class Store(Protocol):
    """Files by name, all in one place; can be sent to another process."""

    @property
    def name(self) -> str:
        """What people call it: a path or a URL."""
        ...

    @property
    def folder(self) -> Path | None:
        """Where its files lie on this machine; None if they do not."""
        ...

    def alone(self) -> AbstractContextManager[None]:
        """Keep other recordings out, as well as the place allows."""
        ...

    def check_room(self, episodes: int, *, episode_bytes: int) -> None:
        """Refuse what will not fit."""
        ...

    def sizes(self) -> dict[str, int]:
        """Return the bytes of each file, by name."""
        ...

    def read(self, name: str) -> bytes:
        """Return the content of a file."""
        ...

    def write(self, name: str, content: bytes) -> None:
        """Write a file, wholly or not at all."""
        ...

    def append(self, name: str, line: str) -> None:
        """Add a line to a file, which need not be there."""
        ...

    def scratch(self, episode_bytes: int) -> AbstractContextManager[Path]:
        """Return a folder to record one episode in."""
        ...

    def keep(self, path: Path) -> None:
        """Take in a finished episode from its scratch folder."""
        ...


def open_store(out: str | Path, *, apart: bool = False) -> Store:
    """Return the store that `out` names: a folder, or a URL such as `s3://bucket/data`.

    Args:
        out: Nothing is made there yet.
        apart: Whether episodes in the making stay out of sight in a folder, because workers that
            are lost may still write; an object store keeps them apart anyway.

    Raises:
        UnknownStore: If fsspec knows no such store.
        MissingExtra: If what it takes is not installed.
    """
    scheme, separator, rest = str(out).partition("://")
    if isinstance(out, Path) or not separator:
        return FolderStore(Path(out), in_place=not apart)
    if scheme in ("file", "local"):
        return FolderStore(Path(rest), in_place=not apart)
    return RemoteStore(str(out).rstrip("/"))
