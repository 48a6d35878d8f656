"""An MCAP in the making out of another's records, byte for byte and in their order.

Its chunks keep the borders that those of the other had: what `dnet` wrote comes out as it was.
"""

import struct
import zlib
from typing import BinaryIO, NamedTuple, TypeVar

from mcap.data_stream import RecordBuilder
from mcap.records import Attachment, Channel, Metadata, Schema
from mcap.writer import CompressionType, Writer

from dnet.datasets.chunk import LARGEST_CHUNK
from dnet.datasets.summary import RECORD, parse
from dnet.recorders.mcap_sink import CHUNK_SIZE

MOST_BESIDE = 10_000
"""Schemas, channels, attachments and metadata that are still believed; an episode has thirty."""
LATEST = 2**63 - 1
"""Nanoseconds that a reader can count."""

_MESSAGE = struct.Struct("<HIQQ")
_CRC = struct.Struct("<I")
_Read = TypeVar("_Read", Schema, Channel, Metadata)
_Described = TypeVar("_Described", Schema, Channel)


class RawMessage(NamedTuple):
    """A message as it was read."""

    channel: int
    """Number of its channel in the file that it comes from."""
    sequence: int
    log_time: int
    publish_time: int
    data: bytes


def read_message(content: memoryview) -> RawMessage:
    """Return the message in a record.

    Raises:
        ValueError, struct.error: If it is none.
    """
    number, sequence, log_time, publish_time = _MESSAGE.unpack_from(content)
    if log_time > LATEST:
        raise ValueError(f"a message at {log_time} ns, later than any can be")
    return RawMessage(number, sequence, log_time, publish_time, bytes(content[_MESSAGE.size :]))


class RawCopy:
    """Takes records as they were read, and writes them at once but for schemas and channels.

    Those wait for the first message that needs them. Every method that takes a record raises one
    of `UNREADABLE` if it is not what it should be, and then has written nothing of it.

    Args:
        target: Where the copy goes.
    """

    def __init__(self, target: BinaryIO) -> None:
        self.topics: dict[int, str] = {}
        """By number of the channel in the file that is copied."""
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        # Numbers in the copy by number in the original; 0 stands for no schema.
        self._new_schemas: dict[int, int] = {0: 0}
        self._new_channels: dict[int, int] = {}
        self._beside = 0
        self._described_bytes = 0
        self._writer = Writer(
            target,
            chunk_size=CHUNK_SIZE,
            compression=CompressionType.NONE,
            enable_crcs=True,
            enable_data_crcs=True,
        )
        self._writer.start(profile="", library="dnet")

    def schema(self, content: memoryview) -> None:
        """Take a schema."""
        self._describe(self._schemas, self._read(Schema, content), len(content))

    def channel(self, content: memoryview) -> None:
        """Take a channel of a schema that was taken, or of none."""
        one = self._read(Channel, content)
        if one.schema_id and one.schema_id not in self._schemas:
            raise ValueError(f"a channel of schema {one.schema_id}, which was not described")
        self._describe(self._channels, one, len(content))
        self.topics[one.id] = one.topic

    def metadata(self, content: memoryview, *, held_back: str) -> Metadata:
        """Take metadata, and return it; that called `held_back` is returned alone."""
        one = self._read(Metadata, content)
        if one.name != held_back:
            self._writer.add_metadata(one.name, one.metadata)
        return one

    def attachment(self, content: memoryview) -> bool:
        """Take an attached file unless it fails its checksum; return whether it was taken."""
        self._count()
        (crc,) = _CRC.unpack(content[-_CRC.size :])
        if crc and zlib.crc32(content[: -_CRC.size]) != crc:
            return False
        one = Attachment.read(parse(content))
        if _written(one)[: -_CRC.size] != content[: -_CRC.size]:
            raise ValueError("an attachment that is not as long as it says")
        self._writer.add_attachment(
            one.create_time, one.log_time, one.name, one.media_type, one.data
        )
        return True

    def message(self, one: RawMessage) -> None:
        """Take a message of a channel in `topics`."""
        number = self._new_channels.get(one.channel)
        if number is None:
            number = self._register(self._channels[one.channel])
        self._writer.add_message(number, one.log_time, one.data, one.publish_time, one.sequence)

    def end_chunk(self) -> None:
        """End the chunk in progress."""
        self._writer.flush()

    def finish(self, name: str, record: dict[str, str]) -> None:
        """Write last metadata, called `name`, and the index."""
        self._writer.flush()
        self._writer.add_metadata(name, record)
        self._writer.finish()

    def _read(self, kind: type[_Read], content: memoryview) -> _Read:
        """Return a record, if writing it again gives the same bytes."""
        self._count()
        one: _Read = kind.read(parse(content))
        if _written(one) != content:
            raise ValueError(f"a {kind.__name__.lower()} that is not as long as it says")
        return one

    def _count(self) -> None:
        # Each of them stays in memory until the end: no file may claim any number.
        self._beside += 1
        if self._beside > MOST_BESIDE:
            raise ValueError(f"more than {MOST_BESIDE} schemas, channels, attachments and metadata")

    def _describe(self, known: dict[int, _Described], new: _Described, size: int) -> None:
        if known.setdefault(new.id, new) != new:
            raise ValueError(f"a second {type(new).__name__.lower()} of number {new.id}")
        self._described_bytes += size
        if self._described_bytes > LARGEST_CHUNK:
            raise ValueError(f"schemas and channels of more than {LARGEST_CHUNK} bytes")

    def _register(self, channel: Channel) -> int:
        schema = self._new_schemas.get(channel.schema_id)
        if schema is None:
            old = self._schemas[channel.schema_id]
            schema = self._writer.register_schema(old.name, old.encoding, old.data)
            self._new_schemas[channel.schema_id] = schema
        number = self._writer.register_channel(
            channel.topic, channel.message_encoding, schema, channel.metadata
        )
        self._new_channels[channel.id] = number
        return number


def _written(record: Schema | Channel | Metadata | Attachment) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    return builder.end()[RECORD.size :]
