"""An MCAP container opened for random access: its index read once, its bytes mapped, not copied.

The stock Python reader decompresses and parses a whole chunk for every query. This one reads the
MessageIndex records (https://mcap.dev/spec), maps the file, or fetches ranges of it from a store,
and slices payloads out of it. Every length in the file is checked against the file before it is
believed, so a damaged or hostile file is refused, not obeyed.
"""

import struct
import zlib
from array import array
from collections import OrderedDict

import numpy as np
from jaxtyping import Int64
from mcap.opcode import Opcode
from mcap.records import Attachment, Metadata

from dnet.datasets.chunk import decompress, is_plain
from dnet.datasets.refusals import damaged
from dnet.datasets.sources import Source, open_source
from dnet.datasets.summary import MAGIC, RECORD, UNREADABLE, ChunkPlace, Extent, parse, read_summary
from dnet.errors import BadEpisode
from dnet.types import Place

CACHED_CHUNKS = 4
LARGEST_ATTACHED = 256 * 2**20
"""Bytes of an attached file or of metadata that are still read; dnet writes 12 KiB."""

Entries = Int64[np.ndarray, "_ 3"]
"""Messages of a topic in file order: log time, chunk, offset in the chunk."""

_MESSAGE = struct.Struct("<BQHIQQ")
_MESSAGE_INDEX = struct.Struct("<BQHI")
_CRC = struct.Struct("<I")
_TIME = struct.Struct("<QQ")


class McapFile:
    """Topics, messages, metadata and attachments of one MCAP file.

    Args:
        path: The file, or its URL; it must have a summary and message indexes, as finished files
            do.
        source: Its bytes, if they are at hand already.
        check: Whether to hold each chunk against its checksum when it is first read.

    Raises:
        MissingPath: If there is no such file.
        BadEpisode: If it is not an MCAP file, or is cut off, or is damaged.
        Unfetched: If a store does not answer.
    """

    def __init__(self, path: Place, *, source: Source | None = None, check: bool = True) -> None:
        self.path = path
        self._check = check
        self._source = open_source(path) if source is None else source
        self._cache: OrderedDict[int, memoryview] = OrderedDict()
        self._checked = set[int]()
        try:
            if self._source.view(0, min(len(MAGIC), len(self._source))) != MAGIC:
                raise BadEpisode(path, "is not an MCAP file", "give an .mcap of `dnet record`")
            self._summary = read_summary(path, self._source)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Let go of the file; views that were handed out stay valid as long as they live."""
        self._cache.clear()
        self._source.close()

    @property
    def chunks(self) -> tuple[ChunkPlace, ...]:
        """Where the chunks lie, in file order."""
        return tuple(self._summary.chunks)

    def entries(self, topic: str) -> Entries:
        """Return where the messages of `topic` lie, in file order; none for an unknown topic."""
        # Numbers in a row take a tenth of the memory of a list of tuples.
        found = array("q")
        channel = self._summary.topics.get(topic)
        if channel is not None:
            for number, chunk in enumerate(self._summary.chunks):
                offset = chunk.indexes.get(channel)
                if offset is not None:
                    for at, time in self._message_index(number, offset, channel=channel):
                        try:
                            found.extend((time, number, at))
                        except OverflowError as error:
                            raise damaged(self.path, f"its index of {topic} is broken") from error
        return np.array(found, dtype=np.int64).reshape(-1, 3)

    def payload(self, chunk: int, offset: int) -> memoryview:
        """Return the content of the message at `offset` of chunk number `chunk`.

        Raises:
            BadEpisode: If there is no message, or the chunk is damaged.
        """
        content = message_at(self._records(chunk), offset)
        if content is None:
            raise damaged(self.path, f"it has no message at byte {offset} of chunk {chunk}")
        return content

    def position(self, chunk: int, offset: int) -> int | None:
        """Return the byte of the file at which the content of that message begins.

        None if the chunk is compressed.
        """
        records = self._records(chunk)
        first, length, _ = self._summary.chunks[chunk]
        if not is_plain(self._source.view(first, first + length)):
            return None
        # The records are the end of a chunk.
        return first + length - len(records) + offset + _MESSAGE.size

    def metadata(self, name: str) -> dict[str, str] | None:
        """Return the metadata record called `name`, or None."""
        place = self._summary.metadata.get(name)
        if place is None:
            return None
        try:
            return Metadata.read(parse(self._record(place, Opcode.METADATA))).metadata
        except UNREADABLE as error:
            raise damaged(self.path, f"its metadata {name} is unreadable ({error})") from error

    @property
    def attachments(self) -> tuple[str, ...]:
        """Names of the attached files."""
        return tuple(self._summary.attachments)

    def attachment(self, name: str) -> bytes | None:
        """Return the attached file called `name`, or None."""
        place = self._summary.attachments.get(name)
        if place is None:
            return None
        try:
            record = self._record(place, Opcode.ATTACHMENT)
            content = Attachment.read(parse(record)).data
            (crc,) = _CRC.unpack(record[-_CRC.size :])
        except UNREADABLE as error:
            raise damaged(self.path, f"its attachment {name} is unreadable ({error})") from error
        if crc and zlib.crc32(record[: -_CRC.size]) != crc:
            raise damaged(self.path, f"its attachment {name} fails its checksum")
        return content

    def _message_index(self, number: int, offset: int, *, channel: int) -> list[tuple[int, int]]:
        """Return offset in the chunk and log time of each message, in file order."""
        chunks = self._summary.chunks
        # A chunk's indexes lie between it and the next chunk: no two chunks can share one.
        first = chunks[number].offset + chunks[number].length
        limit = chunks[number + 1].offset if number + 1 < len(chunks) else len(self._source)
        start = offset + _MESSAGE_INDEX.size
        if first <= offset and start <= limit:
            opcode, length, of, size = _MESSAGE_INDEX.unpack(self._source.view(offset, start))
            whole = length == size + 6 and size <= limit - start and size % _TIME.size == 0
            if opcode == Opcode.MESSAGE_INDEX and whole and of == channel:
                pairs = _TIME.iter_unpack(self._source.view(start, start + size))
                return sorted((at, time) for time, at in pairs)
        raise damaged(self.path, f"the message index of its chunk {number} is broken")

    def _records(self, number: int) -> memoryview:
        """Return the decompressed records of a chunk, checked against its checksum once."""
        cached = self._cache.get(number)
        if cached is not None:
            self._cache.move_to_end(number)
            return cached
        offset, length, _ = self._summary.chunks[number]
        try:
            records, crc = decompress(self._source.view(offset, offset + length))
        except ValueError as error:
            raise damaged(self.path, f"its chunk {number} is unreadable ({error})") from error
        if self._check and number not in self._checked:
            if crc and zlib.crc32(records) != crc:
                raise damaged(self.path, f"its chunk {number} fails its checksum")
            self._checked.add(number)
        self._cache[number] = records
        if len(self._cache) > CACHED_CHUNKS:
            self._cache.popitem(last=False)
        return records

    def _record(self, extent: Extent, opcode: Opcode) -> memoryview:
        offset, length = extent
        if length > len(self._source) or offset > len(self._source) - length:
            raise ValueError("outside the file")
        if length > LARGEST_ATTACHED:
            raise ValueError(f"{length} bytes, at most {LARGEST_ATTACHED} are read")
        record = self._source.view(offset, offset + length)
        kind, size = RECORD.unpack_from(record)
        if kind != opcode or size != length - RECORD.size:
            raise ValueError("not the record it should be")
        return record[RECORD.size :]


def message_at(records: memoryview, offset: int) -> memoryview | None:
    """Return the content of the message at `offset` of a chunk's records, None if none is there."""
    if offset + _MESSAGE.size > len(records):
        return None
    opcode, length, *_ = _MESSAGE.unpack_from(records, offset)
    end = offset + RECORD.size + length
    whole = opcode == Opcode.MESSAGE and offset + _MESSAGE.size <= end <= len(records)
    return records[offset + _MESSAGE.size : end] if whole else None
