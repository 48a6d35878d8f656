"""Files read whole, if they are no larger than what is believed of their kind."""

import json
import os
from io import BytesIO
from pathlib import Path
from typing import Any

from dnet.errors import TooLarge

LARGEST_JSON = 64 * 2**20
"""Bytes of a JSON document, or of lines of them, that are still parsed: parsed ones take ten times
their bytes and more. A manifest has 300 bytes an episode, a training's history 2 KB an epoch."""

_PIECE = 2**20


def read_at_most(path: Path, most: int, *, what: str) -> bytes:
    """Return the content of a file.

    Args:
        path: The file.
        most: Bytes that it may have.
        what: It is, for errors.

    Raises:
        TooLarge: If it has more.
        OSError: If it cannot be read.
    """
    with path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        # Piece by piece, for room is made for all that is asked for, and `most` may be large. What
        # a file says of its length is no limit to what it gives: devices and pipes say 0.
        content = BytesIO()
        while max(size, content.tell()) <= most and (piece := file.read(_PIECE)):
            content.write(piece)
    if max(size, content.tell()) > most:
        raise TooLarge(what, path, max(size, content.tell()), most)
    return content.getvalue()


def parse_json(content: bytes | str) -> Any:
    """Return the value of a JSON document.

    Raises:
        ValueError: If it is none, or lists in lists are too deep to be read.
    """
    try:
        return json.loads(content)
    except RecursionError as error:
        raise ValueError("its lists are too deep") from error


def read_json(path: Path, *, what: str, most: int = LARGEST_JSON) -> Any:
    """Return the value in a JSON file.

    Raises:
        TooLarge: If it has more than `most` bytes.
        ValueError: If it is no JSON.
        OSError: If it cannot be read.
    """
    return parse_json(read_at_most(path, most, what=what))
