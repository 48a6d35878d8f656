"""The summary at the end of an MCAP file: where its chunks, metadata and attachments lie."""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path
from typing import NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Channel, MetadataIndex, Statistics

from dnet.datasets.refusals import cut_off, damaged, unindexed

MAGIC = b"\x89MCAP0\r\n"
RECORD = struct.Struct("<BQ")
"""How every record begins: opcode and length."""
UNREADABLE = (struct.error, ValueError, IndexError, OverflowError, McapError)
"""What parsers raise on bytes that are not what they claim to be."""

_FOOTER = struct.Struct("<BQQQI")
_CHUNK_INDEX = struct.Struct("<QQQQI")
_OFFSET = struct.Struct("<HQ")


class Place(NamedTuple):
    """Where a record lies in the file."""

    offset: int
    length: int


class ChunkPlace(NamedTuple):
    """Where a chunk lies in the file, and where the indexes of its messages do."""

    offset: int
    length: int
    indexes: dict[int, int]
    """Offset of the MessageIndex record by channel."""


@dataclass
class Summary:
    """What the end of the file says of the whole."""

    topics: dict[str, int] = field(default_factory=dict)
    """Channel by topic."""
    chunks: list[ChunkPlace] = field(default_factory=list)
    """In file order; they do not overlap."""
    metadata: dict[str, Place] = field(default_factory=dict)
    attachments: dict[str, Place] = field(default_factory=dict)
    messages: int = 0


def read_summary(path: Path, content: memoryview) -> Summary:
    """Return the summary of the MCAP file that `content` is.

    Args:
        path: Its name, for errors.
        content: All of its bytes.

    Raises:
        BadEpisode: If the file is cut off, has no index, or is damaged.
    """
    end = len(content) - len(MAGIC)
    footer = end - _FOOTER.size
    if footer < len(MAGIC) or content[end:] != MAGIC:
        raise cut_off(path)
    opcode, length, start, _, crc = _FOOTER.unpack_from(content, footer)
    if opcode != Opcode.FOOTER or length != _FOOTER.size - RECORD.size:
        raise cut_off(path)
    if not len(MAGIC) <= start <= footer:
        raise unindexed(path)
    # The checksum covers the summary and the footer up to the checksum itself.
    if crc and zlib.crc32(content[start : end - 4]) != crc:
        raise damaged(path, "its summary fails its checksum")
    summary = Summary()
    try:
        for kind, record in _records(content[start:footer]):
            _take(summary, kind, record)
    except UNREADABLE as error:
        raise damaged(path, f"its summary is unreadable ({error})") from error
    summary.chunks.sort(key=lambda chunk: chunk.offset)
    _refuse_overlaps(path, summary, footer)
    if summary.messages and not any(chunk.indexes for chunk in summary.chunks):
        raise unindexed(path)
    return summary


def parse(record: memoryview) -> ReadDataStream:
    """Return a record's content as the parsers of the mcap package want it."""
    return ReadDataStream(BytesIO(record))


def _records(content: memoryview) -> Iterator[tuple[int, memoryview]]:
    place = 0
    while place < len(content):
        opcode, length = RECORD.unpack_from(content, place)
        place += RECORD.size
        if length > len(content) - place:
            raise ValueError(f"a record of {length} bytes where {len(content) - place} are left")
        yield opcode, content[place : place + length]
        place += length


def _take(summary: Summary, opcode: int, record: memoryview) -> None:
    if opcode == Opcode.CHUNK_INDEX:
        summary.chunks.append(_chunk_place(record))
    elif opcode == Opcode.CHANNEL:
        channel = Channel.read(parse(record))
        summary.topics.setdefault(channel.topic, channel.id)
    elif opcode == Opcode.STATISTICS:
        summary.messages = Statistics.read(parse(record)).message_count
    elif opcode == Opcode.METADATA_INDEX:
        metadata = MetadataIndex.read(parse(record))
        summary.metadata[metadata.name] = Place(metadata.offset, metadata.length)
    elif opcode == Opcode.ATTACHMENT_INDEX:
        attachment = AttachmentIndex.read(parse(record))
        summary.attachments[attachment.name] = Place(attachment.offset, attachment.length)


def _chunk_place(record: memoryview) -> ChunkPlace:
    _, _, offset, length, size = _CHUNK_INDEX.unpack_from(record)
    start = _CHUNK_INDEX.size
    if size > len(record) - start or size % _OFFSET.size:
        raise ValueError(f"a chunk index of {size} bytes")
    return ChunkPlace(offset, length, dict(_OFFSET.iter_unpack(record[start : start + size])))


def _refuse_overlaps(path: Path, summary: Summary, end: int) -> None:
    # Chunks that share bytes would let a small file claim any number of messages.
    place = len(MAGIC)
    for chunk in summary.chunks:
        if chunk.offset < place or chunk.length > end - chunk.offset:
            raise damaged(path, "its chunks overlap or lie outside the file")
        place = chunk.offset + chunk.length
