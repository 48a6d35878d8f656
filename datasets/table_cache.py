"""Arrays that are computed from an episode once, and kept beside the data by its content."""

import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from numpy.typing import NDArray
from platformdirs import user_cache_path
from safetensors import SafetensorError
from safetensors.numpy import load, save

from dnet.datasets.stores import is_url
from dnet.types import Place

FOLDER = ".cache"
"""In a dataset's folder; it can be thrown away."""

Tables = Mapping[str, NDArray[Any]]


@dataclass(frozen=True)
class TableCache:
    """Tables of some kind, in a file an episode, found by what the episode holds.

    A file that cannot be read is computed anew; a folder that cannot be written to costs the time
    of computing, and nothing else.
    """

    folder: Path
    kind: str
    """What the tables are; a word that can be a folder's name."""
    version: str
    """Everything that they depend on besides the episode: another version, other tables."""

    def get(self, digest: str, compute: Callable[[], Tables]) -> Tables:
        """Return the tables of an episode.

        Args:
            digest: SHA-256 of the episode's file.
            compute: Returns them where they are not there yet.
        """
        path = self._path(digest)
        try:
            return load(path.read_bytes())
        except (OSError, SafetensorError):
            tables = compute()
        self._put(path, tables)
        return tables

    def _path(self, digest: str) -> Path:
        version = sha256(self.version.encode()).hexdigest()[:16]
        return self.folder / f"{self.kind}-{version}" / f"{digest}.safetensors"

    def _put(self, path: Path, tables: Tables) -> None:
        # Two processes may do this at a time: each writes a file of its own.
        part = path.with_name(f"{path.name}.{os.getpid()}.part")
        with suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            try:
                part.write_bytes(save(dict(tables)))
                part.replace(path)
            finally:
                part.unlink(missing_ok=True)


def cache_folder(root: Place) -> Path:
    """Return where tables of a dataset are kept: in its folder, or with the user's for a URL."""
    return user_cache_path("dnet") if is_url(root) else Path(root) / FOLDER
