"""What the head of a cloud's file claims, held against its bytes and against what clouds have.

Readers of other people's formats reserve what a head asks for, or look for its end for ever.
"""

import math
import os
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from dnet.errors import HugeCloud

MOST_POINTS = 10_000_000
"""Points of a cloud that are still read: more than any depth camera sees at a time."""
MOST_BYTES = 2**29
"""Bytes of such a file, or of what is packed in it: twenty million points in text."""
LONGEST_HEAD = 64 * 1024
"""Bytes of the head of a .ply or .pcd; such heads have some hundreds."""
DENSEST = 256
"""Bytes that LZF makes of one at most, its format allows for 88."""


@dataclass(frozen=True, slots=True)
class _Claim:
    points: int
    unpacked: int
    """Bytes that its reader will make of it, at least."""
    packed: int
    """Bytes that the file must have for that."""


def check_claims(path: Path) -> None:
    """Refuse a .npy, .ply or .pcd that is, or claims to be, more than a cloud or than it has.

    Raises:
        HugeCloud: If it has, or says that it has, more than `MOST_POINTS` or `MOST_BYTES`.
        ValueError: If it says that it holds more than it has bytes for, or its head has no end.
        OSError: If it cannot be read.
    """
    with path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        if size > MOST_BYTES:
            raise HugeCloud(path, "bytes", size, MOST_BYTES)
        claim = _CLAIMS[path.suffix.lower()](file)
    for what, got, most in (
        ("points", claim.points, MOST_POINTS),
        ("bytes", claim.unpacked, MOST_BYTES),
    ):
        if got > most:
            raise HugeCloud(path, what, got, most)
    if claim.packed > size:
        raise ValueError(f"it claims to hold {claim.packed} bytes or more, and has {size}")


def _npy(file: BinaryIO) -> _Claim:
    version = np.lib.format.read_magic(file)
    if version == (1, 0):
        shape, _, dtype = np.lib.format.read_array_header_1_0(file)
    elif version == (2, 0):
        shape, _, dtype = np.lib.format.read_array_header_2_0(file)
    else:
        raise ValueError(f"it is of version {version}, that of an array of numbers is 1.0 or 2.0")
    size = math.prod(shape) * max(1, dtype.itemsize)
    return _Claim(shape[0] if shape else 1, size, size)


def _ply(file: BinaryIO) -> _Claim:
    lines, _ = _head(file, b"end_header")
    elements = [line[1:] for line in lines if line[:1] == [b"element"] and len(line) > 2]
    vertices = sum(_count(count) for name, count, *_ in elements if name == b"vertex")
    # In whatever way they are stored, elements take a byte each.
    size = sum(_count(count) for _, count, *_ in elements)
    return _Claim(vertices, size, size)


def _pcd(file: BinaryIO) -> _Claim:
    lines, rest = _head(file, b"DATA")
    told = {line[0]: line[1:] for line in lines if line}

    def said(key: bytes) -> list[int]:
        return [_count(word) for word in told.get(key, [])]

    sizes = said(b"SIZE")
    counts = said(b"COUNT") or [1] * len(sizes)
    shape = math.prod(said(b"WIDTH") + said(b"HEIGHT")) if b"WIDTH" in told else 0
    points, values = max(*said(b"POINTS"), shape, 0), sum(counts)
    size = points * sum(a * b for a, b in zip(sizes, counts, strict=False))
    if told.get(b"DATA") == [b"ascii"]:
        # A digit each, and what parts it from the next.
        return _Claim(points, size, max(values, 2 * points * values - 1))
    if told.get(b"DATA") != [b"binary_compressed"]:
        return _Claim(points, size, max(values, size))
    unpacked = max(size, int.from_bytes(rest[4:8], "little"))
    return _Claim(points, unpacked, max(values, unpacked // DENSEST))


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
