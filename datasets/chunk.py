"""The records of one MCAP chunk, decompressed within bounds."""

import struct

import lz4.frame
import zstandard
from mcap.opcode import Opcode

from dnet.datasets.summary import RECORD, UNREADABLE

LARGEST_CHUNK = 64 * 2**20
"""Bytes of a decompressed chunk that are still believed; writers use 256 KiB to 4 MiB."""

_CHUNK = struct.Struct("<QQQII")
_SIZE = struct.Struct("<Q")


def decompress(record: memoryview) -> tuple[memoryview, int]:
    """Return the records of a chunk and their checksum, zero if it has none.

    An uncompressed chunk is a view of `record`.

    Raises:
        ValueError: If `record` is no chunk, or decompresses to another size than it says.
    """
    try:
        return _decompress(record)
    except (*UNREADABLE, zstandard.ZstdError, RuntimeError, EOFError) as error:
        raise ValueError(str(error)) from error


def is_plain(record: memoryview) -> bool:
    """Return whether the records of a chunk that can be decompressed lie in it as they are."""
    return _CHUNK.unpack_from(record, RECORD.size)[-1] == 0


def _decompress(record: memoryview) -> tuple[memoryview, int]:
    opcode, length = RECORD.unpack_from(record)
    if opcode != Opcode.CHUNK or length != len(record) - RECORD.size:
        raise ValueError("not a chunk")
    _, _, size, crc, name_size = _CHUNK.unpack_from(record, RECORD.size)
    place = RECORD.size + _CHUNK.size
    if name_size > len(record) - place:
        raise ValueError("a compression name longer than the chunk")
    compression = str(record[place : place + name_size], "utf-8")
    place += name_size
    (stored,) = _SIZE.unpack_from(record, place)
    place += _SIZE.size
    if stored != len(record) - place:
        raise ValueError(f"{stored} bytes where {len(record) - place} are left")
    if size > LARGEST_CHUNK:
        raise ValueError(f"{size} bytes when decompressed, at most {LARGEST_CHUNK} are taken")
    content = _plain(record[place:], compression, size)
    if len(content) != size:
        raise ValueError(f"{len(content)} bytes where {size} were promised")
    return content, crc


def _plain(content: memoryview, compression: str, size: int) -> memoryview:
    # Both decompressors read one byte more than promised at most, whatever their frame says.
    if compression == "zstd":
        stream = zstandard.ZstdDecompressor().stream_reader(content)
        return memoryview(stream.read(size + 1))
    if compression == "lz4":
        frame = lz4.frame.LZ4FrameDecompressor()
        return memoryview(frame.decompress(content, max_length=size + 1))
    if compression:
        raise ValueError(f"compression {compression[:40]!r}; only zstd and lz4 are known")
    return content
