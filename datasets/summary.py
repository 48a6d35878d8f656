"""The summary at the end of an MCAP file: where its chunks, metadata and attachments lie."""

import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from typing import NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Channel, MetadataIndex, Statistics

from dnet.datasets.refusals import cut_off, damaged, unindexed
from dnet.datasets.sources import Source
from dnet.types import Place

MAGIC = b"\x89MCAP0\r\n"
RECORD = struct.Struct("<BQ")
"""How every record begins: opcode and length."""
UNREADABLE = (struct.error, ValueError, IndexError, OverflowError, McapError)
"""What parsers raise on bytes that are not what they claim to be."""
LARGEST_SUMMARY = 64 * 2**20
"""Bytes of the summary that are still read: those of an episode of some hundred thousand chunks,
which is as many as has 50 GB."""
MOST_NAMES = 4096
"""Channels, attachments or metadata records of a file that are still read; dnet writes 13, 3, 2."""

_FOOTER = struct.Struct("<BQQQI")
_CHUNK_INDEX = struct.Struct("<QQQQI")
_OFFSET = struct.Struct("<HQ")
_CRC = struct.Struct("<I")
_NAMED: dict[int, str] = {
    Opcode.CHANNEL: "channels",
    Opcode.ATTACHMENT_INDEX: "attachments",
    Opcode.METADATA_INDEX: "metadata records",
}


class Extent(NamedTuple):
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
    metadata: dict[str, Extent] = field(default_factory=dict)
    attachments: dict[str, Extent] = field(default_factory=dict)
    messages: int = 0


def read_summary(name: Place, source: Source) -> Summary:
    """Return the summary of an MCAP file.

    Args:
        name: Its path or URL, for errors.
        source: Its bytes, of which only the last are read.

    Raises:
        BadEpisode: If the file is cut off, has no index, or is damaged.
    """
    size = len(source)
    end = size - len(MAGIC)
    footer = end - _FOOTER.size
    if footer < len(MAGIC) or source.view(end, size) != MAGIC:
        raise cut_off(name)
    opcode, length, start, _, crc = _FOOTER.unpack(source.view(footer, end))
    if opcode != Opcode.FOOTER or length != _FOOTER.size - RECORD.size:
        raise cut_off(name)
    if not len(MAGIC) <= start <= footer:
        raise unindexed(name)
    if end - start > LARGEST_SUMMARY:
        why = f"its summary has {end - start} bytes, at most {LARGEST_SUMMARY} are read"
        raise damaged(name, why)
    content = source.view(start, end)
    # The checksum covers the summary and the footer up to the checksum itself.
    if crc and zlib.crc32(content[: -_CRC.size]) != crc:
        raise damaged(name, "its summary fails its checksum")
    summary = Summary()
    try:
        seen = Counter[int]()
        for kind, record in _records(content[: footer - start]):
            seen[kind] += 1
            if kind in _NAMED and seen[kind] > MOST_NAMES:
                raise ValueError(f"more than {MOST_NAMES} {_NAMED[kind]}")
            _take(summary, kind, record)
    except UNREADABLE as error:
        raise damaged(name, f"its summary is unreadable ({error})") from error
    summary.chunks.sort(key=lambda chunk: chunk.offset)
    _refuse_overlaps(name, summary, footer)
    if summary.messages and not any(chunk.indexes for chunk in summary.chunks):
        raise unindexed(name)
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
        summary.metadata[metadata.name] = Extent(metadata.offset, metadata.length)
    elif opcode == Opcode.ATTACHMENT_INDEX:
        attachment = AttachmentIndex.read(parse(record))
        summary.attachments[attachment.name] = Extent(attachment.offset, attachment.length)


def _chunk_place(record: memoryview) -> ChunkPlace:
    _, _, offset, length, size = _CHUNK_INDEX.unpack_from(record)
    start = _CHUNK_INDEX.size
    if size > len(record) - start or size % _OFFSET.size:
        raise ValueError(f"a chunk index of {size} bytes")
    return ChunkPlace(offset, length, dict(_OFFSET.iter_unpack(record[start : start + size])))


def _refuse_overlaps(name: Place, summary: Summary, end: int) -> None:
    # Chunks that share bytes would let a small file claim any number of messages.
    place = len(MAGIC)
    for chunk in summary.chunks:
        if chunk.offset < place or chunk.length > end - chunk.offset:
            raise damaged(name, "its chunks overlap or lie outside the file")
        place = chunk.offset + chunk.length
