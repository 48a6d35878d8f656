"""What the records of an MCAP file say, gathered so that it can be compared with its index."""

import zlib
from collections import Counter
from dataclasses import dataclass, field

from mcap.opcode import Opcode
from mcap.records import (
    AttachmentIndex,
    Channel,
    ChunkIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
)

from dnet.datasets.summary import parse
from dnet.tools.validate_findings import Findings
from dnet.tools.validate_records import Record

AnyIndex = AttachmentIndex | ChunkIndex | MetadataIndex
CRC_SIZE = 4


@dataclass
class Contents:
    """What a file holds besides the content of its messages."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    metadata: list[Metadata] = field(default_factory=list)
    attachments: list[tuple[str, memoryview]] = field(default_factory=list)
    """Name and content, in file order."""
    indexes: dict[tuple[int, int], AnyIndex] = field(default_factory=dict)
    """What the summary should say, by the index's opcode and the place of what is indexed."""
    chunks: int = 0
    counts: Counter[int] = field(default_factory=Counter)
    """Messages by channel."""
    first: int | None = None
    """Earliest log time in nanoseconds; None without messages."""
    last: int = 0
    _raw: dict[tuple[int, int], bytes] = field(default_factory=dict)

    def describe(self, record: Record, findings: Findings, *, again: bool = False) -> None:
        """Take up a schema or a channel, or compare it with what it was before.

        Args:
            record: Which of them; read no further than it must be.
            findings: Takes what is wrong with it.
            again: Whether it is the summary's, which may only repeat.
        """
        what = "schema" if record.opcode == Opcode.SCHEMA else "channel"
        number = int.from_bytes(record.body[:2], "little")
        known = self._raw.get((record.opcode, number))
        if known is not None:
            if known != record.body:
                findings.error("channel", f"{what} {number} is described in two ways")
            return
        if again:
            findings.error("channel", f"{what} {number} is in the summary alone")
        if record.opcode == Opcode.SCHEMA:
            self.schemas[number] = Schema.read(parse(record.body))
        else:
            channel = Channel.read(parse(record.body))
            self.channels[number] = channel
            if channel.schema_id and channel.schema_id not in self.schemas:
                findings.error(
                    "channel", f"{channel.topic} has schema {channel.schema_id}, which is none"
                )
        self._raw[record.opcode, number] = bytes(record.body)

    def count(self, channel: int, time: int) -> None:
        """Count a message."""
        self.counts[channel] += 1
        self.first = time if self.first is None else min(self.first, time)
        self.last = max(self.last, time)

    def statistics(self) -> Statistics:
        """Return what the statistics should be."""
        return Statistics(
            attachment_count=len(self.attachments),
            channel_count=len(self.channels),
            channel_message_counts=dict(self.counts),
            chunk_count=self.chunks,
            message_count=self.counts.total(),
            message_end_time=self.last,
            message_start_time=self.first or 0,
            metadata_count=len(self.metadata),
            schema_count=len(self.schemas),
        )


def hold(findings: Findings, check: str, *, what: str, wanted: int, content: memoryview) -> None:
    """Compare a checksum with the content it is of; 0 says that none was written."""
    if not wanted:
        findings.warn("no-checksum", f"{what} has no checksum: no damage can be noticed")
        return
    found = zlib.crc32(content)
    if found != wanted:
        findings.error(check, f"{what} has checksum {found:08x}, not {wanted:08x}")


def kind(record: Record) -> str:
    """Return the name of a record's kind."""
    try:
        return Opcode(record.opcode).name
    except ValueError:
        return f"of unknown kind {record.opcode}"
