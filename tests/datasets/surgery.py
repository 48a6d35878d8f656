"""MCAP files cut open: their records found, changed, and closed again with the right checksums."""

import struct
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from dnet.datasets.summary import MAGIC
from dnet.tools.validate_records import Record, record_at


@dataclass(frozen=True)
class Message:
    """A message on its way from one file to another."""

    topic: str
    number: int
    time: int
    content: bytes


Change = Callable[[Message], Sequence[Message]]


def rewrite(
    source: Path,
    target: Path,
    change: Change = lambda one: [one],
    *,
    compression: CompressionType = CompressionType.NONE,
    metadata: Callable[[str, dict[str, str]], dict[str, str] | None] = lambda _name, old: old,
    attachments: dict[str, bytes] | None = None,
    schemas: Callable[[str, str, bytes], tuple[str, str, bytes]] = lambda name, encoding, data: (
        name,
        encoding,
        data,
    ),
    encodings: dict[str, str] | None = None,
) -> Path:
    """Copy an episode with the stock tools, all checksums on, changing what is asked for.

    A topic's messages go under new numbers if some are left out; metadata become what is
    returned, or nothing for None.
    """
    with source.open("rb") as old, target.open("wb") as new:
        reader = make_reader(old)
        writer = Writer(new, chunk_size=2000, compression=compression, enable_data_crcs=True)
        writer.start()
        records = list(reader.iter_metadata())
        for record in records[:1]:
            _add(writer, record.name, metadata(record.name, record.metadata))
        attached = {one.name: one.data for one in reader.iter_attachments()} | (attachments or {})
        for name, data in attached.items():
            writer.add_attachment(0, 0, name, "", data)
        channels: dict[str, int] = {}
        counts: dict[str, int] = {}
        read: dict[str, int] = {}
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            assert schema is not None
            number = read.get(channel.topic, 0)
            read[channel.topic] = number + 1
            for one in change(Message(channel.topic, number, message.log_time, message.data)):
                if one.topic not in channels:
                    described = schemas(schema.name, schema.encoding, schema.data)
                    encoding = (encodings or {}).get(one.topic, channel.message_encoding)
                    channels[one.topic] = writer.register_channel(
                        one.topic, encoding, writer.register_schema(*described)
                    )
                count = counts.get(one.topic, 0)
                counts[one.topic] = count + 1
                writer.add_message(channels[one.topic], one.time, one.content, one.time, count)
        for record in records[1:]:
            _add(writer, record.name, metadata(record.name, record.metadata))
        writer.finish()
    return target


def _add(writer: Writer, name: str, record: dict[str, str] | None) -> None:
    if record is not None:
        writer.add_metadata(name, record)


def only(topic: str, number: int, content: Callable[[bytes], bytes | None]) -> Change:
    """Return the change of one message's content; None leaves it out."""

    def change(one: Message) -> list[Message]:
        if (one.topic, one.number) != (topic, number):
            return [one]
        changed = content(one.content)
        return [] if changed is None else [replace(one, content=changed)]

    return change


def records(content: bytes | bytearray) -> list[Record]:
    """Return the records of a whole file outside of its chunks."""
    found: list[Record] = []
    place, end = len(MAGIC), len(content) - len(MAGIC)
    view = memoryview(bytes(content))
    while place < end:
        found.append(record_at(view, place, end))
        place = found[-1].end
    return found


def mend(content: bytearray, *, crc: Callable[[bytes], int] = zlib.crc32) -> bytes:
    """Return the file with the checksums that its bytes call for, or with others.

    Compressed chunks keep theirs.
    """
    for record in records(content):
        body = record.start + 9
        end = record.end
        if record.opcode == Opcode.CHUNK:
            (name,) = struct.unpack_from("<I", content, body + 28)
            if not name:
                struct.pack_into("<I", content, body + 24, crc(bytes(content[body + 40 : end])))
        elif record.opcode == Opcode.ATTACHMENT:
            struct.pack_into("<I", content, end - 4, crc(bytes(content[body : end - 4])))
        elif record.opcode == Opcode.DATA_END:
            struct.pack_into("<I", content, body, crc(bytes(content[: record.start])))
        elif record.opcode == Opcode.FOOTER:
            (start,) = struct.unpack_from("<Q", content, body)
            struct.pack_into("<I", content, end - 4, crc(bytes(content[start : end - 4])))
    return bytes(content)


def with_summary(content: bytes, extra: bytes) -> bytes:
    """Return the file with more records at the end of its summary, which loses its checksum."""
    footer = records(content)[-1].start
    start, _, _ = struct.unpack_from("<QQI", content, footer + 9)
    end = struct.pack("<BQQQI", Opcode.FOOTER, 20, start, 0, 0)
    return content[:footer] + extra + end + MAGIC


def packed(opcode: int, body: bytes) -> bytes:
    """Return a record."""
    return struct.pack("<BQ", opcode, len(body)) + body
