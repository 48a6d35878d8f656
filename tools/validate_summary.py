"""The summary of an MCAP file: whether it says of the data what the data says of itself."""

from collections import Counter
from dataclasses import fields

from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, ChunkIndex, Footer, MetadataIndex, Statistics

from dnet.datasets.summary import MAGIC, parse
from dnet.tools.validate_contents import CRC_SIZE, AnyIndex, Contents, hold, kind
from dnet.tools.validate_findings import Findings
from dnet.tools.validate_records import Record, record_at

UNJUDGED = ChunkIndex(0, 0, "", 0, 0, 0, {}, 0, 0)
"""Stands for the index of a chunk that cannot be read: whatever it says is as good."""

_INDEXES: dict[int, tuple[type[AnyIndex], str]] = {
    Opcode.CHUNK_INDEX: (ChunkIndex, "chunk"),
    Opcode.ATTACHMENT_INDEX: (AttachmentIndex, "attachment"),
    Opcode.METADATA_INDEX: (MetadataIndex, "metadata"),
}


def check_summary(
    content: memoryview, start: int, *, contents: Contents, findings: Findings
) -> None:
    """Compare the summary with what the data holds.

    Args:
        content: All of the file.
        start: Where the data ends.
        contents: What it holds; its indexes are used up.
        findings: Takes what is wrong.

    Raises:
        ValueError, McapError: If the summary cannot be read; one of `UNREADABLE`.
    """
    seen = Counter[int]()
    place, end, last = start, len(content) - len(MAGIC), 0
    while place < end:
        record = record_at(content, place, end)
        last = record.opcode
        seen[last] += 1
        place = record.end
        if record.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            contents.describe(record, findings, again=True)
        elif record.opcode == Opcode.STATISTICS:
            _compare(Statistics.read(parse(record.body)), contents.statistics(), findings)
        elif record.opcode in _INDEXES:
            _index(record, contents, findings)
        elif record.opcode == Opcode.FOOTER:
            _footer(content, record, start=start, findings=findings)
        elif record.opcode != Opcode.SUMMARY_OFFSET:
            findings.error("summary", f"it holds a record {kind(record)}, where none may be")
    if seen[Opcode.FOOTER] != 1 or last != Opcode.FOOTER:
        findings.error("record", f"it has {seen[Opcode.FOOTER]} footers, one must be its end")
    if not seen[Opcode.STATISTICS]:
        findings.warn("statistics", "there are none: lost messages cannot be noticed")
    if seen[Opcode.CHANNEL] != len(contents.channels):
        findings.error(
            "summary",
            f"it has {seen[Opcode.CHANNEL]} channels, the data has {len(contents.channels)}",
        )
    for opcode, missing in contents.indexes:
        what = _INDEXES[opcode][1]
        findings.error(f"{what}-index", f"it lacks the {what} at byte {missing}")


def _index(record: Record, contents: Contents, findings: Findings) -> None:
    read, what = _INDEXES[record.opcode]
    index: AnyIndex = read.read(parse(record.body))
    place = index.chunk_start_offset if isinstance(index, ChunkIndex) else index.offset
    wanted = contents.indexes.pop((record.opcode, place), None)
    if wanted is None:
        findings.error(f"{what}-index", f"it has a {what} at byte {place}, where none is")
    elif wanted is not UNJUDGED and wanted != index:
        findings.error(f"{what}-index", f"what it says of the {what} at byte {place} is not so")


def _footer(content: memoryview, record: Record, *, start: int, findings: Findings) -> None:
    footer = Footer.read(parse(record.body))
    if footer.summary_start != start:
        findings.error(
            "summary", f"it begins at byte {footer.summary_start}, the data ends at {start}"
        )
    covered = content[footer.summary_start : record.end - CRC_SIZE]
    hold(
        findings,
        "summary-checksum",
        what="the summary",
        wanted=footer.summary_crc,
        content=covered,
    )


def _compare(said: Statistics, wanted: Statistics, findings: Findings) -> None:
    said.channel_message_counts = {
        channel: count for channel, count in said.channel_message_counts.items() if count
    }
    for one in fields(Statistics):
        says, holds = getattr(said, one.name), getattr(wanted, one.name)
        if says != holds:
            findings.error("statistics", f"they say {one.name} {says}, the file has {holds}")
