"""How large a cloud is by the word of its file, before anything is made of it."""

import math
import os
import struct
from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import BinaryIO

import numpy as np

from dnet.errors import HugeCloud

MOST_POINTS = 10_000_000
"""Points of a cloud that are still read: more than any depth camera sees at a time."""
MOST_BYTES = 2_000_000_000
"""Bytes of such a file, or of what is packed in it: ten million points as long lines of text."""

_MOST_LINES, _LONGEST_LINE = 1000, 4096
_PACKED = struct.Struct("<II")


def refuse_huge(path: Path) -> None:
    """Look at the size of a file, and at what its first lines say, and refuse too much.

    What the lines don't say, or say wrongly, is left to the reader of the file.

    Args:
        path: A `.npy`, `.ply` or `.pcd` file.

    Raises:
        HugeCloud: If it has, or says that it has, more than `MOST_POINTS` or `MOST_BYTES`.
    """
    with path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        try:
            points, unpacked = _CLAIMS[path.suffix.lower()](file)
        # Of what is no such file at all, its reader says so in words of its own.
        except Exception:
            points, unpacked = 0, 0
    for what, got, most in (
        ("points", points, MOST_POINTS),
        ("bytes", max(size, unpacked), MOST_BYTES),
    ):
        if got > most:
            raise HugeCloud(path, what, got, most)


def _npy(file: BinaryIO) -> tuple[int, int]:
    version = np.lib.format.read_magic(file)
    first = version == (1, 0)
    read = np.lib.format.read_array_header_1_0 if first else np.lib.format.read_array_header_2_0
    shape, _, dtype = read(file)
    return (shape[0] if shape else 1), math.prod(shape) * dtype.itemsize


def _ply(file: BinaryIO) -> tuple[int, int]:
    words = [line.split() for line in _head(file, b"end_header")]
    counts = [(line[1], int(line[2])) for line in words if line[:1] == [b"element"]]
    # No element takes less than a byte.
    return sum(n for name, n in counts if name == b"vertex"), sum(n for _, n in counts)


def _pcd(file: BinaryIO) -> tuple[int, int]:
    said: dict[bytes, list[bytes]] = {}
    for line in _head(file, b"DATA"):
        name, *values = line.split() or [b""]
        said[name] = values
    points = int(said[b"POINTS"][0])
    sizes = [int(value) for value in said[b"SIZE"]]
    counts = [int(value) for value in said.get(b"COUNT", [b"1"] * len(sizes))]
    unpacked = points * sum(size * count for size, count in zip(sizes, counts, strict=True))
    if said[b"DATA"] == [b"binary_compressed"]:
        _, told = _PACKED.unpack(file.read(_PACKED.size))
        unpacked = max(unpacked, told)
    shape = int(said[b"WIDTH"][0]) * int(said[b"HEIGHT"][0])
    return max(points, shape), unpacked


def _head(file: BinaryIO, last: bytes) -> Iterator[bytes]:
    """Yield the lines of a file up to the one that begins with `last`."""
    for line in islice(iter(lambda: file.readline(_LONGEST_LINE), b""), _MOST_LINES):
        yield line
        if line.startswith(last):
            return


_CLAIMS: Mapping[str, Callable[[BinaryIO], tuple[int, int]]] = {
    ".npy": _npy,
    ".ply": _ply,
    ".pcd": _pcd,
}
"""By suffix of the file: points, and bytes when unpacked, as it says."""
