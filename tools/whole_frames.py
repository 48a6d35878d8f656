"""A copy of an episode with those of its frames that are whole, made in one reading from the front.

A frame is whole if its `/frame` is there, which the recorder writes last, and all else that a
frame consists of came before it.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode

from dnet.datasets import messages
from dnet.datasets.chunk import LARGEST_CHUNK
from dnet.datasets.front_to_back import Record, read_records
from dnet.datasets.reader import DEPTH, FRAME, FRAME_TOPICS, MASK
from dnet.datasets.summary import UNREADABLE
from dnet.errors import BrokenRecord
from dnet.recorders.json_text import to_json
from dnet.tools.raw_copy import RawCopy, RawMessage, read_message

EPISODE, RESULT, REPAIR = "dnet.episode", "dnet.result", "dnet.repair"
FRAMED = (*FRAME_TOPICS, DEPTH, MASK)
"""Topics whose messages belong to a frame, and are nothing without it."""
LARGEST_FRAME = LARGEST_CHUNK
"""Bytes that are held back until the end of their frame is found."""
MESSAGE_COST = 256
"""Bytes of memory that a message takes besides its content."""
LARGEST_GROWTH = 1000
"""How many times as long as the file its copy may become; compressors hardly shrink a cloud."""


@dataclass(frozen=True, slots=True)
class Salvage:
    """What an unfinished or damaged episode was found to hold."""

    described: bool
    """Whether it says what was recorded: its metadata `dnet.episode`."""
    frames: int
    """Whole frames."""
    dropped: int
    """Messages that were read, and belong to no whole frame."""
    finished: bool
    """Whether the recording ended by itself, and nothing of it is lost."""
    reason: str
    """What is wrong with it, and at which byte."""


def copy_whole_frames(source: Path, target: BinaryIO) -> Salvage:
    """Write what is whole of `source` into `target`, an MCAP with an index.

    A result is copied if nothing was lost; otherwise metadata `dnet.repair` says what was.
    """
    copy = _Copy(source, target)
    broken = None
    try:
        for record in read_records(source):
            copy.take(record)
    except BrokenRecord as error:
        broken = error
    return copy.end(broken)


class _Copy:
    def __init__(self, source: Path, target: BinaryIO) -> None:
        self._source = source
        self._target = target
        self._copy = RawCopy(target)
        self._size = source.stat().st_size
        # Messages since the last whole frame, from the first on that belongs to the next.
        self._pending: list[RawMessage] = []
        self._pending_bytes = 0
        self._frame: dict[str, RawMessage] = {}
        self._numbers: dict[str, int] = {}
        self._frames = 0
        self._spoiled = 0
        self._described = False
        self._result: dict[str, str] | None = None

    def take(self, record: Record) -> None:
        """Copy a record, or hold it back until the end of its frame is found.

        Raises:
            BrokenRecord: If it is not what it should be; nothing of it was copied.
        """
        try:
            self._take(record)
        except UNREADABLE as error:
            raise BrokenRecord(self._source, record.byte, str(error) or "no record") from error

    def end(self, broken: BrokenRecord | None) -> Salvage:
        """Write the index; `broken` says why not all of the source was read."""
        dropped = 0
        for message in self._pending:
            if self._copy.topics[message.channel] in FRAMED:
                dropped += 1
            else:
                self._copy.message(message)
        lossless = not (broken or dropped or self._spoiled)
        reason = self._reason(broken, dropped)
        if self._result is not None and lossless:
            self._copy.finish(RESULT, self._result)
        else:
            told = {
                "source": self._source.name,
                "reason": reason,
                "frames": self._frames,
                "dropped": dropped,
            }
            self._copy.finish(REPAIR, {key: to_json(value) for key, value in told.items()})
        finished = self._result is not None and lossless
        return Salvage(self._described, self._frames, dropped, finished, reason)

    def _reason(self, broken: BrokenRecord | None, dropped: int) -> str:
        if broken is not None:
            reason = f"byte {broken.byte}: {broken.why}"
        elif self._result is None:
            reason = f"byte {self._size}: it ends there without a result"
        else:
            reason = "it is complete but for its index or its name"
        if dropped:
            reason += f"; {dropped} messages of a frame that is not whole are left out"
        if self._spoiled:
            reason += f"; {self._spoiled} attachments that fail their checksum are left out"
        return reason

    def _take(self, record: Record) -> None:
        opcode, content, _ = record
        if opcode == Opcode.MESSAGE:
            self._take_message(read_message(content))
        elif opcode == Opcode.CHUNK:
            self._end_chunk()
        elif opcode == Opcode.SCHEMA:
            self._copy.schema(content)
        elif opcode == Opcode.CHANNEL:
            self._copy.channel(content)
        elif opcode == Opcode.ATTACHMENT:
            if not self._copy.attachment(content):
                self._spoiled += 1
        elif opcode == Opcode.METADATA:
            # Whether a result still holds is known at the end.
            one = self._copy.metadata(content, held_back=RESULT)
            self._described |= one.name == EPISODE
            if one.name == RESULT:
                self._result = one.metadata

    def _end_chunk(self) -> None:
        if not self._pending:
            self._copy.end_chunk()
        # Chunks of a few bytes can say that they unpack to 64 MiB each.
        if self._target.tell() > LARGEST_GROWTH * self._size + LARGEST_CHUNK:
            raise ValueError(f"it unpacks to more than {LARGEST_GROWTH} times its size")

    def _take_message(self, message: RawMessage) -> None:
        topic = self._copy.topics.get(message.channel)
        if topic is None:
            raise ValueError(f"a message of channel {message.channel}, which was not described")
        if topic not in FRAMED and not self._pending:
            self._copy.message(message)
            return
        self._hold_back(message, topic)
        if topic == FRAME:
            self._end_frame(memoryview(message.data))

    def _hold_back(self, message: RawMessage, topic: str) -> None:
        self._pending.append(message)
        self._pending_bytes += len(message.data) + MESSAGE_COST
        if self._pending_bytes > LARGEST_FRAME:
            raise ValueError(f"frame {self._frames} has no end within {LARGEST_FRAME} bytes")
        if topic in FRAMED:
            if topic in self._frame:
                raise ValueError(f"frame {self._frames} has a second message on {topic}")
            # A reader goes by the first channel of a topic: a frame on another is lost to it.
            if self._numbers.setdefault(topic, message.channel) != message.channel:
                raise ValueError(f"frame {self._frames} is on a second channel of {topic}")
            self._frame[topic] = message

    def _end_frame(self, end: memoryview) -> None:
        missing = [topic for topic in FRAME_TOPICS if topic not in self._frame]
        if missing:
            raise ValueError(f"frame {self._frames} lacks {', '.join(missing)}")
        if len({message.log_time for message in self._frame.values()}) > 1:
            raise ValueError(f"the messages of frame {self._frames} are of different times")
        try:
            index, _, _ = messages.read_frame_end(end)
        except messages.UNREADABLE as error:
            raise ValueError(f"the end of frame {self._frames} is unreadable ({error})") from error
        if index != self._frames:
            raise ValueError(f"frame {self._frames} says that it is number {index}")
        for message in self._pending:
            self._copy.message(message)
        self._pending.clear()
        self._pending_bytes = 0
        self._frame.clear()
        self._frames += 1
