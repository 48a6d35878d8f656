"""Arrays that are computed from an episode once, and kept beside the data by its content."""

import os
import struct
import zlib
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray
from platformdirs import user_cache_path

from dnet.datasets.stores import is_url
from dnet.files.plain_names import plain_name
from dnet.files.whole_file import whole_file
from dnet.types import Place

FOLDER = ".cache"
"""In a dataset's folder; it can be thrown away."""

Records = NDArray[Any]
"""A structured array, a record a frame."""

_SUM = struct.Struct("<I")


@dataclass(frozen=True)
class TableCache:
    """Records of some kind, in a file an episode, found by what the episode holds."""

    folder: Path
    kind: str
    """What the records are; a word that can be a folder's name."""
    version: str
    """Everything that they depend on besides the episode: another version, other records."""

    def find(self, digest: str, dtype: np.dtype[Any], *, checked: bool = False) -> Records | None:
        """Return the records of an episode, mapped; None if they are not there, or not whole.

        Args:
            digest: SHA-256 of the episode's file.
            dtype: Of the records.
            checked: Whether to read all of them first, and see that none has changed.
        """
        path = self._path(digest)
        try:
            records = cast("np.memmap", np.load(path, mmap_mode="r", allow_pickle=False))
            if records.dtype != dtype or records.ndim != 1:
                return None
            with path.open("rb") as file:
                place = file.seek(-_SUM.size, os.SEEK_END)
                (told,) = _SUM.unpack(file.read(_SUM.size))
        except (OSError, ValueError, EOFError):
            return None
        if place != records.offset + records.nbytes or (checked and told != _sum(records)):
            return None
        return records

    def put(self, digest: str, records: Records) -> None:
        """Keep the records of an episode.

        Raises:
            Unwritten: If they cannot be written.
        """
        with whole_file(self._path(digest)) as part, part.open("wb") as file:
            np.save(file, records, allow_pickle=False)
            # Behind the records, where numpy does not look.
            file.write(_SUM.pack(_sum(records)))

    def _path(self, digest: str) -> Path:
        version = sha256(self.version.encode()).hexdigest()[:16]
        plain_name(digest, what="the SHA-256 of an episode")
        return self.folder / f"{self.kind}-{version}" / f"{digest}.npy"


def _sum(records: Records) -> int:
    return zlib.crc32(np.ascontiguousarray(records).view(np.uint8).data)


def cache_folder(root: Place) -> Path:
    """Return where tables of a dataset are kept.

    In its folder, or with the user's other caches for a URL and a folder that is not to be
    written to.
    """
    if is_url(root) or not os.access(root, os.W_OK):
        return user_cache_path("dnet")
    return Path(root) / FOLDER
