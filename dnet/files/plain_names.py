"""Names out of somebody's file, held to be names before they become part of a path."""

from pathlib import PurePosixPath, PureWindowsPath

from dnet.errors import BadName

LONGEST_NAME = 255
"""Bytes of a name in UTF-8; file systems take no longer ones."""


def plain_name(text: object, *, what: str) -> str:
    """Return `text` if it is the name of one file, that leads to no other place.

    Args:
        text: As a file says it.
        what: It is, for errors.

    Raises:
        BadName: If it is empty, too long, no text, the name of a folder above, or holds what parts
            a path on any system, or what cannot be printed.
    """
    why = _fault(text)
    if why is not None:
        raise BadName(what, text, why)
    return str(text)


def plain_path(text: object, *, what: str) -> PurePosixPath:
    """Return `text` if it is a path below a folder, each part a plain name.

    Raises:
        BadName: If it is not.
    """
    parts = text.split("/") if isinstance(text, str) else [text]
    for part in parts:
        why = _fault(part)
        if why is not None:
            raise BadName(what, text, why)
    return PurePosixPath(str(text))


def _fault(text: object) -> str | None:
    """Return what is wrong with a name, None for nothing."""
    if not isinstance(text, str):
        return "no text"
    if not text:
        return "empty"
    # A name that is no text of any encoding has no bytes either.
    if len(text.encode("utf-8", "surrogatepass")) > LONGEST_NAME:
        return f"longer than {LONGEST_NAME} bytes"
    if not text.isprintable():
        return "not printable"
    if text in (".", "..") or "/" in text or "\\" in text or PureWindowsPath(text).drive:
        return "a path and not a name"
    return None
