"""What the head of a cloud's file claims, held against the bytes that the file has.

Readers of other people's formats reserve what a head asks for, or look for its end for ever.
"""

import math
import os
from pathlib import Path
from typing import BinaryIO

import numpy as np

LARGEST_CLOUD_FILE = 2**29
"""Bytes of a cloud's file that are still read: 20 million points in text."""
LONGEST_HEAD = 64 * 1024
"""Bytes of the head of a .ply or .pcd; such heads have some hundreds."""
DENSEST = 256
"""Bytes that LZF makes of one at most, its format allows for 88."""


def check_claims(path: Path) -> None:
    """Refuse a .npy, .ply or .pcd that claims to hold more than it has bytes for.

    Raises:
        ValueError: If it does, or is larger than any cloud, or its head has no end.
        OSError: If it cannot be read.
    """
    with path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        if size > LARGEST_CLOUD_FILE:
            raise ValueError(f"it has {size} bytes, at most {LARGEST_CLOUD_FILE} are read")
        claimed = _CLAIMS[path.suffix.lower()](file)
    if claimed > size:
        raise ValueError(f"it claims to hold {claimed} bytes or more, and has {size}")


def _npy(file: BinaryIO) -> int:
    version = np.lib.format.read_magic(file)
    if version == (1, 0):
        shape, _, dtype = np.lib.format.read_array_header_1_0(file)
    elif version == (2, 0):
        shape, _, dtype = np.lib.format.read_array_header_2_0(file)
    else:
        raise ValueError(f"it is of version {version}, that of an array of numbers is 1.0 or 2.0")
    return math.prod(shape) * max(1, dtype.itemsize)


def _ply(file: BinaryIO) -> int:
    lines, _ = _head(file, b"end_header")
    # In whatever way they are stored, elements take a byte each.
    return sum(_count(line[2]) for line in lines if line[:1] == [b"element"] and len(line) > 2)


def _pcd(file: BinaryIO) -> int:
    lines, rest = _head(file, b"DATA")
    told = {line[0]: line[1:] for line in lines if line}
    points = max(_count(one) for key in (b"POINTS", b"WIDTH") for one in told.get(key, [b"0"]))
    sizes = [_count(one) for one in told.get(b"SIZE", [])]
    counts = [_count(one) for one in told.get(b"COUNT", [])] or [1] * len(sizes)
    values = sum(counts)
    if told.get(b"DATA") == [b"ascii"]:
        # A digit each, and what parts it from the next.
        return max(values, 2 * points * values - 1)
    wanted = points * sum(a * b for a, b in zip(sizes, counts, strict=False))
    if told.get(b"DATA") != [b"binary_compressed"]:
        return max(values, wanted)
    unpacked = int.from_bytes(rest[4:8], "little")
    return max(values, max(unpacked, wanted) // DENSEST)


def _head(file: BinaryIO, end: bytes) -> tuple[list[list[bytes]], bytes]:
    """Return the words of each line of a head, its last one too, and what follows it."""
    content = file.read(LONGEST_HEAD)
    lines: list[list[bytes]] = []
    place = 0
    while place < len(content):
        stop = content.find(b"\n", place)
        stop = len(content) if stop < 0 else stop
        words = content[place:stop].split()
        lines.append(words)
        place = stop + 1
        if words[:1] == [end]:
            return lines, content[place:]
    raise ValueError(f"its head has no line {end.decode()} in its first {LONGEST_HEAD} bytes")


def _count(word: bytes) -> int:
    # Python reads 1_000 too, and refuses very long numbers slowly.
    if not word.isdigit() or len(word) > 18:
        raise ValueError(f"{word[:40]!r} where a number must be")
    return int(word)


_CLAIMS = {".npy": _npy, ".ply": _ply, ".pcd": _pcd}
