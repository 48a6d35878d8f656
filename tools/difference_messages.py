"""Which messages and metadata of two episode files differ, whatever way they are packed."""

from hashlib import blake2b
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Channel, Metadata

from dnet.datasets.front_to_back import Record, read_records
from dnet.datasets.summary import UNREADABLE, parse
from dnet.errors import BrokenRecord
from dnet.tools.raw_copy import read_message


def differing_messages(one: Path, other: Path) -> dict[str, int]:
    """Return the number of the first message that differs, by topic.

    Metadata go by "metadata" and their name. A message differs if its time or its content does, or
    if only one of the files has it; where in the files they lie does not matter.

    Raises:
        BrokenRecord: If one of the files is damaged.
    """
    first, second = _digests(one), _digests(other)
    found = {
        name: _first_difference(first.get(name, []), second.get(name, []))
        for name in sorted({*first, *second})
    }
    return {name: number for name, number in found.items() if number is not None}


def _first_difference(one: list[bytes], other: list[bytes]) -> int | None:
    if one == other:
        return None
    pairs = enumerate(zip(one, other, strict=False))
    shorter = min(len(one), len(other))
    return next((number for number, (mine, yours) in pairs if mine != yours), shorter)


def _digests(path: Path) -> dict[str, list[bytes]]:
    """Return a hash of each message, in file order, by topic."""
    topics: dict[int, str] = {}
    found: dict[str, list[bytes]] = {}
    for record in read_records(path):
        try:
            read = _read(record, topics)
        except UNREADABLE as error:
            raise BrokenRecord(path, record.byte, str(error) or "no record") from error
        if read is not None:
            name, content = read
            found.setdefault(name, []).append(blake2b(content, digest_size=16).digest())
    return found


def _read(record: Record, topics: dict[int, str]) -> tuple[str, bytes] | None:
    """Return topic and content of a message, None for what is none; learn the topics by number."""
    if record.opcode == Opcode.CHANNEL:
        channel = Channel.read(parse(record.content))
        topics[channel.id] = channel.topic
    elif record.opcode == Opcode.METADATA:
        metadata = Metadata.read(parse(record.content))
        return f"metadata {metadata.name}", repr(sorted(metadata.metadata.items())).encode()
    elif record.opcode == Opcode.MESSAGE:
        message = read_message(record.content)
        if message.channel not in topics:
            raise ValueError(f"a message of channel {message.channel}, which was not described")
        return topics[message.channel], message.log_time.to_bytes(8, "little") + message.data
    return None
