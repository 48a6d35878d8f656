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


def open_store(out: str | Path, *, shared: bool = False) -> Store:
    """Return the store that `out` names: a folder, or a URL such as `s3://bucket/data`.

    Args:
        out: Nothing is made there yet.
        shared: Whether other machines write there too. In a folder, episodes in the making then
            stay out of each other's way: a lost worker may still write.

    Raises:
        UnknownStore: If fsspec knows no such store.
        MissingExtra: If what it takes is not installed.
    """
    scheme, separator, rest = str(out).partition("://")
    if isinstance(out, Path) or not separator:
        folder = Path(out)
    elif scheme in ("file", "local"):
        folder = Path(rest)
    else:
        return RemoteStore(f"{scheme}://{rest.rstrip('/')}")
    return FolderStore(folder.resolve(), in_place=False) if shared else FolderStore(folder)
