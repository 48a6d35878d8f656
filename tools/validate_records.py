"""MCAP records one after another, as they lie in a file or in a chunk, within their bounds."""

import struct
from dataclasses import dataclass

from mcap.records import AttachmentIndex

from dnet.datasets.summary import RECORD

_CHUNK = struct.Struct("<QQQII")
_MESSAGE = struct.Struct("<HIQQ")
_MESSAGE_INDEX = struct.Struct("<HI")
_TIMES = struct.Struct("<QQ")
_SIZE, _LONG_SIZE = struct.Struct("<I"), struct.Struct("<Q")


@dataclass(frozen=True, slots=True)
class Record:
    """A record and where it lies."""

    opcode: int
    start: int
    body: memoryview
    """All of it but opcode and length."""

    @property
    def end(self) -> int:
        """Where the next record begins."""
        return self.start + RECORD.size + len(self.body)


@dataclass(frozen=True, slots=True)
class ChunkHead:
    """What a chunk says of itself."""

    first: int
    """Log time of its earliest message, in nanoseconds."""
    last: int
    size: int
    """Bytes when decompressed."""
    compression: str


@dataclass(frozen=True, slots=True)
class MessageHead:
    """What a message says of itself."""

    channel: int
    sequence: int
    time: int
    """Log time in nanoseconds."""


def record_at(content: memoryview, place: int, end: int) -> Record:
    """Return the record at `place`, which must end by `end`.

    Raises:
        ValueError: If it does not.
    """
    if end - place < RECORD.size:
        raise ValueError(f"{end - place} bytes at byte {place} are no record")
    opcode, length = RECORD.unpack_from(content, place)
    left = end - place - RECORD.size
    if length > left:
        raise ValueError(f"a record of {length} bytes at byte {place}, where {left} are left")
    start = place + RECORD.size
    return Record(opcode, place, content[start : start + length])


def chunk_head(body: memoryview) -> ChunkHead:
    """Return the head of a chunk that can be decompressed."""
    first, last, size, _, name_size = _CHUNK.unpack_from(body)
    name = str(body[_CHUNK.size : _CHUNK.size + name_size], "utf-8")
    return ChunkHead(first, last, size, name)


def stored_size(body: memoryview) -> int:
    """Return how many bytes of records a chunk that can be decompressed holds as it lies."""
    *_, name_size = _CHUNK.unpack_from(body)
    return len(body) - _CHUNK.size - name_size - _LONG_SIZE.size


def message_parts(body: memoryview) -> tuple[MessageHead, memoryview]:
    """Return the head and the content of a message.

    Raises:
        struct.error: If it has no head.
    """
    channel, sequence, time, _ = _MESSAGE.unpack_from(body)
    return MessageHead(channel, sequence, time), body[_MESSAGE.size :]


def message_index(body: memoryview) -> tuple[int, memoryview]:
    """Return the channel of a message index, and its entries: log time and offset, 8 bytes each.

    Raises:
        ValueError: If its size does not fit.
        struct.error: If it has none.
    """
    channel, size = _MESSAGE_INDEX.unpack_from(body)
    if size != len(body) - _MESSAGE_INDEX.size or size % _TIMES.size:
        raise ValueError(f"a message index of {size} bytes in a record of {len(body)}")
    return channel, body[_MESSAGE_INDEX.size :]


def attachment_parts(record: Record) -> tuple[AttachmentIndex, memoryview, int]:
    """Return what the index should say of an attachment, its content and its checksum.

    Unlike the mcap package's parser this one copies nothing.

    Raises:
        ValueError: If its sizes do not fit.
        struct.error: If it has none.
    """
    body = record.body
    logged, created = _TIMES.unpack_from(body)
    place, names = _TIMES.size, []
    for _ in range(2):
        (size,) = _SIZE.unpack_from(body, place)
        place += _SIZE.size
        names.append(str(body[place : place + size], "utf-8"))
        place += size
    (size,) = _LONG_SIZE.unpack_from(body, place)
    place += _LONG_SIZE.size
    if size != len(body) - place - _SIZE.size:
        raise ValueError(f"{size} bytes of content in a record of {len(body)}")
    (crc,) = _SIZE.unpack_from(body, place + size)
    index = AttachmentIndex(
        offset=record.start,
        length=record.end - record.start,
        log_time=logged,
        create_time=created,
        data_size=size,
        name=names[0],
        media_type=names[1],
    )
    return index, body[place : place + size], crc
