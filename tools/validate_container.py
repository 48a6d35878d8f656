"""An MCAP file from front to back: every record held against its checksum and its index.

Readers follow the index; this goes by the records alone, and asks whether the index says the
same. The file is believed nothing: work and memory stay within a multiple of its size.
"""

from array import array
from collections.abc import Callable

import numpy as np
from jaxtyping import UInt64
from mcap.opcode import Opcode
from mcap.records import ChunkIndex, DataEnd, Metadata, MetadataIndex

from dnet.datasets.chunk import LARGEST_CHUNK, decompress
from dnet.datasets.summary import MAGIC, UNREADABLE, parse
from dnet.tools.validate_contents import CRC_SIZE, Contents, hold, kind
from dnet.tools.validate_findings import Findings
from dnet.tools.validate_records import (
    Record,
    attachment_parts,
    chunk_head,
    message_index,
    message_parts,
    record_at,
    stored_size,
)
from dnet.tools.validate_summary import UNJUDGED, check_summary

MOST_INFLATION = 100
"""Decompressed bytes for each byte of the file that are still read; clouds shrink by 8 %."""
MOST_DESCRIPTIONS = 2**14
"""Schemas and channels in chunks, with those that are repeated; dnet writes 13 of each."""

Take = Callable[[str, int, int, memoryview], None]
"""Is handed topic, sequence, log time (ns) and content of every message, in file order."""

_ENTRY = 16
"""Bytes of an entry of a message index: log time and offset."""


def walk(content: memoryview, findings: Findings, take: Take) -> Contents:
    """Return what an MCAP file holds, having handed every message to `take`.

    Args:
        content: All of the file; it must end as MCAP files end.
        findings: Takes what is wrong with it.
        take: Takes the messages.
    """
    walker = _Walker(content, findings, take)
    try:
        walker.run()
    except UNREADABLE as error:
        # Behind a record that is none, nothing says where the next one begins.
        findings.error("record", f"reading stops: {error or type(error).__name__}")
    return walker.contents


class _Walker:
    """The state of one reading of one file."""

    def __init__(self, content: memoryview, findings: Findings, take: Take) -> None:
        self.contents = Contents()
        self._content = content
        self._findings = findings
        self._take = take
        self._end = len(content) - len(MAGIC)
        self._inflated = 0
        self._descriptions = 0

    def run(self) -> None:
        record = record_at(self._content, len(MAGIC), self._end)
        if record.opcode != Opcode.HEADER:
            self._findings.error("record", f"it begins with a record {kind(record)}, not a header")
        place = record.end
        while True:
            record = record_at(self._content, place, self._end)
            if record.opcode == Opcode.DATA_END:
                break
            place = self._data(record)
        crc = DataEnd.read(parse(record.body)).data_section_crc
        data = self._content[: record.start]
        hold(self._findings, "data-checksum", what="the data", wanted=crc, content=data)
        if len(record.body) != CRC_SIZE:
            self._findings.error("record", f"the end of the data has {len(record.body)} bytes")
        check_summary(self._content, record.end, contents=self.contents, findings=self._findings)

    def _data(self, record: Record) -> int:
        """Take a record of the data section and return where the next one begins."""
        if record.opcode == Opcode.CHUNK:
            return self._chunk(record)
        if record.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            self.contents.describe(record, self._findings)
        elif record.opcode == Opcode.METADATA:
            self._metadata(record)
        elif record.opcode == Opcode.ATTACHMENT:
            self._attachment(record)
        elif record.opcode == Opcode.MESSAGE:
            self._message(record)
            self._findings.error(
                "message-index", f"a message at byte {record.start} is in no chunk: no index has it"
            )
        else:
            self._findings.error(
                "record", f"a record {kind(record)} at byte {record.start}, where none may be"
            )
        return record.end

    def _metadata(self, record: Record) -> None:
        metadata = Metadata.read(parse(record.body))
        self.contents.metadata.append(metadata)
        self.contents.indexes[Opcode.METADATA_INDEX, record.start] = MetadataIndex(
            offset=record.start, length=record.end - record.start, name=metadata.name
        )

    def _attachment(self, record: Record) -> None:
        index, content, crc = attachment_parts(record)
        covered, what = record.body[:-CRC_SIZE], f"attachment {index.name}"
        hold(self._findings, "attachment-checksum", what=what, wanted=crc, content=covered)
        self.contents.indexes[Opcode.ATTACHMENT_INDEX, record.start] = index
        self.contents.attachments.append((index.name, content))

    def _message(self, record: Record) -> tuple[int, int]:
        """Hand on a message; return its channel and log time."""
        head, content = message_parts(record.body)
        self.contents.count(head.channel, head.time)
        channel = self.contents.channels.get(head.channel)
        if channel is None:
            self._findings.error("channel", f"a message of channel {head.channel}, which is none")
        else:
            self._take(channel.topic, head.sequence, head.time, content)
        return head.channel, head.time

    def _chunk(self, record: Record) -> int:
        number = self.contents.chunks
        self.contents.chunks += 1
        entries, offsets, after = self._message_indexes(record.end)
        place = Opcode.CHUNK_INDEX, record.start
        try:
            records, crc = decompress(self._content[record.start : record.end])
        except ValueError as error:
            self._findings.error("chunk", f"chunk {number} cannot be read: {error}")
            self.contents.indexes[place] = UNJUDGED
            return after
        head, what = chunk_head(record.body), f"chunk {number}"
        self._inflate(head.size if head.compression else 0)
        hold(self._findings, "chunk-checksum", what=what, wanted=crc, content=records)
        self.contents.indexes[place] = ChunkIndex(
            chunk_length=record.end - record.start,
            chunk_start_offset=record.start,
            compression=head.compression,
            compressed_size=stored_size(record.body),
            message_end_time=head.last,
            message_index_length=after - record.end,
            message_index_offsets=offsets,
            message_start_time=head.first,
            uncompressed_size=head.size,
        )
        found = self._read(number, records, most=sum(map(len, entries.values())) // _ENTRY)
        self._compare(number, found, entries)
        times = np.concatenate([_pairs(pairs)[:, 0] for pairs in found.values()] or [_pairs(b"")])
        if len(times) and (times.min(), times.max()) != (head.first, head.last):
            self._findings.error(
                "chunk-index",
                f"chunk {number} says that it is from {head.first} to {head.last} ns, "
                f"its messages are from {times.min()} to {times.max()} ns",
            )
        return after

    def _inflate(self, size: int) -> None:
        self._inflated += size
        most = MOST_INFLATION * len(self._content) + LARGEST_CHUNK
        if self._inflated > most:
            raise ValueError(
                f"its chunks decompress to more than {most} bytes, {MOST_INFLATION} times the file"
            )

    def _message_indexes(self, place: int) -> tuple[dict[int, memoryview], dict[int, int], int]:
        """Return the indexes behind a chunk: entries and place by channel, and their end."""
        indexes: dict[int, memoryview] = {}
        offsets: dict[int, int] = {}
        while place < self._end and self._content[place] == Opcode.MESSAGE_INDEX:
            record = record_at(self._content, place, self._end)
            channel, entries = message_index(record.body)
            if channel in indexes:
                self._findings.error(
                    "message-index", f"channel {channel} has a second index at byte {place}"
                )
            indexes[channel], offsets[channel] = entries, place
            place = record.end
        return indexes, offsets, place

    def _read(self, number: int, records: memoryview, *, most: int) -> "dict[int, array[int]]":
        """Take the records of a chunk; return log time and offset of its messages by channel."""
        found: dict[int, array[int]] = {}
        place = 0
        try:
            while place < len(records):
                record = record_at(records, place, len(records))
                if record.opcode == Opcode.MESSAGE:
                    # What no index has is not read: few bytes may decompress to many messages.
                    if not most:
                        raise ValueError("its indexes have no more messages")
                    most -= 1
                    channel, time = self._message(record)
                    found.setdefault(channel, array("Q")).extend((time, place))
                else:
                    self._describe(record)
                place = record.end
        except UNREADABLE as error:
            self._findings.error("chunk", f"reading chunk {number} stops at byte {place}: {error}")
        return found

    def _describe(self, record: Record) -> None:
        if record.opcode not in (Opcode.SCHEMA, Opcode.CHANNEL):
            raise ValueError(f"a record {kind(record)} may not be in a chunk")
        self._descriptions += 1
        if self._descriptions > MOST_DESCRIPTIONS:
            raise ValueError(f"the file has more than {MOST_DESCRIPTIONS} schemas and channels")
        self.contents.describe(record, self._findings)

    def _compare(
        self, number: int, found: "dict[int, array[int]]", indexes: dict[int, memoryview]
    ) -> None:
        for channel in sorted(found.keys() | indexes.keys()):
            wanted, got = _pairs(indexes.get(channel, b"")), _pairs(found.get(channel, b""))
            if not np.array_equal(_ordered(wanted), _ordered(got)):
                self._findings.error(
                    "message-index",
                    f"the index of channel {channel} in chunk {number} has {len(wanted)} messages, "
                    f"the chunk has {len(got)} others",
                )


def _pairs(content: "memoryview | bytes | array[int]") -> UInt64[np.ndarray, "_ 2"]:
    return np.frombuffer(content, "<u8").reshape(-1, 2)


def _ordered(pairs: UInt64[np.ndarray, "_ 2"]) -> UInt64[np.ndarray, "_ 2"]:
    return pairs[np.lexsort(pairs.T)]
