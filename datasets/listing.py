"""Which logs lie in a folder or under a URL, and what tells that one of them has changed."""

import os
from pathlib import Path
from typing import NamedTuple

from dnet.datasets.sources import said, version_of
from dnet.datasets.stores import file_system, is_url
from dnet.errors import MissingPath, Unfetched
from dnet.types import Place


class Listed(NamedTuple):
    """A file of a dataset."""

    name: str
    version: str
    """Changes when the file does."""
    size: int
    """In bytes."""


def list_logs(root: Place) -> list[Listed]:
    """Return the `.mcap` files right in a folder or under a URL, sorted by name.

    Raises:
        MissingPath: If there is no such folder.
        Unfetched: If a store does not answer.
    """
    found = _remote(str(root)) if is_url(root) else _local(Path(root))
    return sorted(one for one in found if one.name.endswith(".mcap"))


def local_version(status: os.stat_result) -> str:
    """Return what changes when a file of this machine does."""
    return f"{status.st_size}-{status.st_mtime_ns}"


def _local(root: Path) -> list[Listed]:
    if not root.is_dir():
        raise MissingPath(root, "directory", f"record into it with `dnet record {root}`")
    with os.scandir(root) as found:
        return [
            Listed(entry.name, local_version(entry.stat()), entry.stat().st_size)
            for entry in found
            if entry.is_file()
        ]


def _remote(url: str) -> list[Listed]:
    files, path = file_system(url, doing="reading")
    files.invalidate_cache()
    try:
        found = files.ls(path, detail=True)
    except FileNotFoundError as error:
        raise MissingPath(url, "folder", f"record into it with `dnet record {url}`") from error
    # Stores raise what they like: botocore's errors are not even OSErrors.
    except Exception as error:
        raise Unfetched(url, said(error)) from error
    return [
        Listed(Path(one["name"]).name, version_of(one), int(one["size"]))
        for one in found
        if one["type"] == "file"
    ]
