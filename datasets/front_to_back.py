"""An MCAP file read from front to back, record by record, up to its end or its first damage.

It needs no index, and holds one record at a time. The file is read, not mapped: one that is
emptied meanwhile, by a recording that begins anew, ends the reading and not the process.
"""

import os
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.opcode import Opcode

from dnet.datasets.chunk import LARGEST_CHUNK, decompress
from dnet.datasets.summary import MAGIC, RECORD
from dnet.errors import BrokenRecord

LARGEST_RECORD = LARGEST_CHUNK + 64 * 1024
"""Bytes of a record that are still believed; the largest is a chunk with its header."""

_CRC = struct.Struct("<I")
_IN_CHUNKS = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)


class Record(NamedTuple):
    """One record of the data."""

    opcode: int
    content: memoryview
    """Without opcode and length; empty for a chunk, whose records come before it."""
    byte: int
    """Where it begins in the file, or the chunk does that holds it."""


def read_records(path: Path) -> Iterator[Record]:
    """Yield the records of the data in file order, a chunk after those that it holds.

    The data ends with its end record, or where the file does between two records. A chunk is
    held against its checksum before the first of its records is given out.

    Raises:
        BrokenRecord: Where the file is cut within a record, is damaged, or cannot be read.
    """
    try:
        with path.open("rb") as file:
            yield from _Reading(path, file).records()
    except OSError as error:
        raise BrokenRecord(path, 0, f"it cannot be opened ({error.strerror})") from error


class _Reading:
    def __init__(self, path: Path, file: BinaryIO) -> None:
        self._path = path
        self._file = file
        self._size = os.fstat(file.fileno()).st_size
        self._crc = 0

    def records(self) -> Iterator[Record]:
        place = min(len(MAGIC), self._size)
        if self._bytes(0, place) != MAGIC:
            raise self._broken(0, "it does not begin as an MCAP file does")
        self._crc = zlib.crc32(MAGIC)
        while place < self._size:
            head = self._bytes(place, min(RECORD.size, self._size - place))
            left = self._size - place - RECORD.size
            opcode, length = RECORD.unpack(head.ljust(RECORD.size, b"\0"))
            if opcode in (Opcode.DATA_END, Opcode.FOOTER):
                self._check_end(place, opcode, left)
                return
            # A file system that lost power leaves zeros in place of what it had not yet written.
            if not opcode:
                raise self._broken(place, "no record begins there")
            if length > left:
                raise self._broken(
                    place, f"a record is cut off, {max(left, 0)} bytes after it began"
                )
            if length > LARGEST_RECORD:
                raise self._broken(place, f"a record of {length} bytes, more than is believed")
            record = self._bytes(place, RECORD.size + length)
            self._crc = zlib.crc32(record, self._crc)
            content = memoryview(record)[RECORD.size :]
            if opcode == Opcode.CHUNK:
                yield from self._unpacked(place, record)
                content = content[:0]
            yield Record(opcode, content, place)
            place += len(record)

    def _unpacked(self, place: int, record: bytes) -> Iterator[Record]:
        try:
            content, crc = decompress(memoryview(record))
        except ValueError as error:
            raise self._broken(place, f"a chunk is unreadable ({error})") from error
        if crc and zlib.crc32(content) != crc:
            raise self._broken(place, "a chunk fails its checksum")
        start = 0
        while start < len(content):
            opcode, length, start = self._within(place, content, start)
            yield Record(opcode, content[start : start + length], place)
            start += length

    def _within(self, place: int, content: memoryview, start: int) -> tuple[int, int, int]:
        """Return opcode, length and beginning of the content of a chunk's next record."""
        left = len(content) - start - RECORD.size
        if left >= 0:
            opcode, length = RECORD.unpack_from(content, start)
            if opcode in _IN_CHUNKS and length <= left:
                return opcode, length, start + RECORD.size
        raise self._broken(place, "a chunk holds what is no record")

    def _check_end(self, place: int, opcode: int, left: int) -> None:
        """Hold all that was read against the checksum at its end, if that is there."""
        if opcode != Opcode.DATA_END or left < _CRC.size:
            return
        (crc,) = _CRC.unpack(self._bytes(place + RECORD.size, _CRC.size))
        if crc and crc != self._crc:
            raise self._broken(place, "the data before it fails its checksum")

    def _bytes(self, place: int, length: int) -> bytes:
        try:
            self._file.seek(place)
            content = self._file.read(length)
        except OSError as error:
            raise self._broken(place, f"the disk does not give it ({error.strerror})") from error
        if len(content) < length:
            raise self._broken(place, "the file became shorter while it was read")
        return content

    def _broken(self, byte: int, why: str) -> BrokenRecord:
        return BrokenRecord(self._path, byte, why)
