"""Where logs lie: on this machine by path, or in any store that fsspec knows by URL."""

from pathlib import Path
from typing import Any

from fsspec.core import url_to_fs

from dnet.errors import MissingExtra, UnknownStore
from dnet.types import Place

S3 = ("s3", "s3a")
LOCAL = ("file", "local")


def is_url(place: Place) -> bool:
    """Return whether `place` is a URL of a store, and not a path of this machine."""
    return isinstance(place, str) and "://" in place and place.partition("://")[0] not in LOCAL


def as_place(text: Place) -> Place:
    """Return a URL as it is, without a slash at its end, and all else as a path."""
    if is_url(text):
        return str(text).rstrip("/")
    name = str(text)
    return Path(
        name.partition("://")[2] if name.startswith(tuple(f"{s}://" for s in LOCAL)) else name
    )


def join(place: Place, name: str) -> Place:
    """Return the file called `name` in a folder."""
    return f"{place}/{name}" if isinstance(place, str) else place / name


def file_system(url: str, *, doing: str) -> tuple[Any, str]:
    """Return the fsspec file system of a URL, which fsspec keeps for each process, and its path.

    Args:
        url: Such as "s3://bucket/data". Addresses and credentials come from where the store's
            own tools have them.
        doing: What is wanted of it, for errors: "reading" or "writing to".

    Raises:
        UnknownStore: If fsspec knows no such store.
        MissingExtra: If what it takes is not installed.
    """
    try:
        found: tuple[Any, str] = url_to_fs(url)
    except ImportError as error:
        if url.partition("://")[0] in S3:
            raise MissingExtra("s3fs", "s3", f"{doing} {url}") from error
        raise UnknownStore(url, str(error)) from error
    except ValueError as error:
        raise UnknownStore(url, str(error)) from error
    return found
