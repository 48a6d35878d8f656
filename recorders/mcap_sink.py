"""An MCAP file in the making: channels that register themselves, chunks that reach the disk."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from google.protobuf.message import Message
from mcap.writer import CompressionType, Writer
from mcap_protobuf.schema import build_file_descriptor_set

from dnet.recorders.json_text import to_json
from dnet.recorders.schemas import JSON_SCHEMAS

CHUNK_SIZE = 256 * 1024
MEDIA_TYPES = {".json": "application/json", ".urdf": "application/xml", ".vtk": "text/plain"}
"""By suffix of an attachment; what the system knows of them differs from machine to machine."""


class McapSink:
    """Writes messages, metadata and attachments; the same calls give the same bytes."""

    def __init__(self, path: Path) -> None:
        """Open `path` anew; what was there is lost."""
        self._channels: dict[str, int] = {}
        self._counts: dict[str, int] = {}
        self._ended = False
        self._file = path.open("wb")
        # Uncompressed: float32 clouds shrink by 8 % and would read four times as slowly.
        self._writer = Writer(
            self._file,
            chunk_size=CHUNK_SIZE,
            compression=CompressionType.NONE,
            enable_crcs=True,
            enable_data_crcs=True,
        )
        self._writer.start(profile="", library="dnet")

    @property
    def closed(self) -> bool:
        """Whether nothing more can be written."""
        return self._file.closed

    def put(self, topic: str, message: Message, now: int) -> None:
        """Write a protobuf message at `now`, in nanoseconds."""
        if topic not in self._channels:
            descriptor = build_file_descriptor_set(type(message))
            schema = self._writer.register_schema(
                message.DESCRIPTOR.full_name, "protobuf", descriptor.SerializeToString()
            )
            self._channels[topic] = self._writer.register_channel(topic, "protobuf", schema)
        self._write(topic, message.SerializeToString(), now)

    def put_json(self, topic: str, record: Mapping[str, Any], now: int) -> None:
        """Write a JSON message of a topic of `JSON_SCHEMAS`."""
        if topic not in self._channels:
            name, schema = JSON_SCHEMAS[topic]
            number = self._writer.register_schema(name, "jsonschema", to_json(schema).encode())
            self._channels[topic] = self._writer.register_channel(topic, "json", number)
        self._write(topic, to_json(record).encode(), now)

    def add_metadata(self, name: str, record: Mapping[str, str]) -> None:
        """Write a metadata record after everything that was put before."""
        self._writer.flush()
        self._writer.add_metadata(name, dict(record))

    def attach(self, name: str, content: bytes) -> None:
        """Write an attached file."""
        kind = MEDIA_TYPES.get(Path(name).suffix, "application/octet-stream")
        self._writer.add_attachment(0, 0, name, kind, content)

    def flush(self) -> None:
        """End the chunk in progress and hand everything to the system."""
        self._writer.flush()

    def close(self, *, durable: bool = False) -> None:
        """Write the index and close; `durable` waits until the bytes are on the disk.

        A second call finishes what the first was interrupted in.
        """
        if self._file.closed:
            return
        try:
            if not self._ended:
                self._ended = True
                self._writer.finish()
            self._file.flush()
            if durable:
                os.fsync(self._file.fileno())
        finally:
            self._file.close()

    def _write(self, topic: str, content: bytes, now: int) -> None:
        sequence = self._counts.get(topic, 0)
        self._writer.add_message(self._channels[topic], now, content, now, sequence)
        self._counts[topic] = sequence + 1
