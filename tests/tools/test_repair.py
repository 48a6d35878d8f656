"""Whatever a crash leaves of an episode, its whole frames come back, and the original stays."""

import json
import os
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tyro
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from dnet.commands.inspect_repair import Repair
from dnet.datasets.chunk import LARGEST_CHUNK
from dnet.datasets.front_to_back import LARGEST_RECORD, read_records
from dnet.datasets.mcap_file import McapFile
from dnet.datasets.messages import read_result
from dnet.datasets.reader import EpisodeReader
from dnet.errors import (
    BrokenRecord,
    MissingPath,
    NoEpisodes,
    NothingSaved,
    OccupiedOutput,
    SharedFolder,
    Unwritten,
)
from dnet.geometry.camera import Camera
from dnet.recorders.episode import EpisodeWriter
from dnet.tools import raw_copy, whole_frames
from dnet.tools.repair import Repaired, repair, repair_directory
from dnet.types import Frame
from tests.recorders.rollout import ARMS, frames, meta, with_image, write, write_servo
from tests.tools.killed_recording import recorded

HEADER = struct.Struct("<BQ")
FOOTER = 8 + 29
SEEN = frames(3)
Change = Callable[[str, int, bytes], bytes | None]


def episode(path: Path, seen: Sequence[Frame] = SEEN) -> Path:
    """A finished episode with small attachments and a camera."""
    camera = Camera(width=8, height=6)
    attachments = {"psm.urdf": b"<robot/>", "../../escape.txt": b"text"}
    with EpisodeWriter(
        path, meta(path.stem), arms=ARMS, attachments=attachments, camera=camera
    ) as writer:
        for one in seen:
            writer.add(one)
        writer.finish({"frames": len(seen)})
    return path


def rewritten(
    source: Path, target: Path, change: Change = lambda _topic, _number, old: old, **options: Any
) -> Path:
    """Copy an episode with the stock tools, changing or dropping (None) some messages."""
    with source.open("rb") as old, target.open("wb") as new:
        reader = make_reader(old)
        summary = reader.get_summary()
        assert summary is not None
        writer = Writer(new, **options)
        writer.start()
        records = list(reader.iter_metadata())
        for record in records:
            if record.name != "dnet.result":
                writer.add_metadata(record.name, record.metadata)
        for one in reader.iter_attachments():
            writer.add_attachment(0, 0, one.name, one.media_type, one.data)
        for schema in summary.schemas.values():
            writer.register_schema(schema.name, schema.encoding, schema.data)
        for channel in summary.channels.values():
            writer.register_channel(channel.topic, channel.message_encoding, channel.schema_id)
        counts: dict[str, int] = {}
        for _, channel, message in reader.iter_messages(log_time_order=False):
            number = counts.get(channel.topic, 0)
            counts[channel.topic] = number + 1
            content = change(channel.topic, number, message.data)
            if content is not None:
                at = message.log_time
                writer.add_message(channel.id, at, content, at, message.sequence)
        for record in records:
            if record.name == "dnet.result":
                writer.add_metadata(record.name, record.metadata)
        writer.finish()
    return target


def places(content: bytes | bytearray) -> list[tuple[int, int]]:
    """Opcode and beginning of each record of a whole file, found without what is tested."""
    found = []
    place = 8
    while place < len(content) - 8:
        opcode, length = HEADER.unpack_from(content, place)
        found.append((opcode, place))
        place += HEADER.size + length
    return found


def frame_ends(path: Path) -> list[int]:
    """Where the chunk ends that holds the end of each frame."""
    file = McapFile(path)
    chunks = [file.chunks[number] for _, number, _ in file.entries("/frame").tolist()]
    file.close()
    return [chunk.offset + chunk.length for chunk in chunks]


def assert_same_frames(path: Path, seen: Sequence[Frame]) -> None:
    with EpisodeReader(path) as read:
        assert len(read) == len(seen)
        for index, wanted in enumerate(seen):
            found = read.frame(index)
            assert (found.time, found.kind) == (wanted.time, wanted.kind)
            np.testing.assert_array_equal(found.cloud, wanted.cloud)
            np.testing.assert_array_equal(found.nodes, wanted.nodes)
            np.testing.assert_array_equal(found.grasp, wanted.grasp)
            np.testing.assert_array_equal(found.joints, wanted.joints)
            assert (found.image is None) == (wanted.image is None)
            if found.image is not None and wanted.image is not None:
                np.testing.assert_array_equal(found.image.depth, wanted.image.depth)
                np.testing.assert_array_equal(found.image.mask, wanted.image.mask)


def told(path: Path) -> dict[str, Any]:
    """What the metadata `dnet.repair` of a file says."""
    record = McapFile(path).metadata("dnet.repair")
    assert record is not None
    return read_result(record)


def saved(path: Path, seen: Sequence[Frame], *, finished: bool = False) -> Repaired:
    """Repair a file, see that it holds just these frames, and remove the new file again."""
    before = path.read_bytes()
    found = repair(path)
    assert path.read_bytes() == before
    assert found.outcome == "saved"
    assert found.frames_kept == len(seen)
    assert found.saved is not None
    assert found.bytes_kept == found.saved.stat().st_size
    assert_same_frames(found.saved, seen)
    with EpisodeReader(found.saved) as read:
        assert read.finished is finished
        assert (McapFile(found.saved).metadata("dnet.repair") is None) is finished
    if not finished:
        assert told(found.saved)["reason"] == found.note
        assert told(found.saved)["source"] == path.name
        assert told(found.saved)["frames"] == len(seen)
    found.saved.unlink()
    with suppress(OSError):
        found.saved.parent.rmdir()
    return found


def nothing(path: Path) -> str:
    """See that a file holds nothing to save and leaves nothing behind; return why."""
    before = path.read_bytes()
    found = repair(path)
    assert (found.outcome, found.saved, found.frames_kept) == ("nothing to save", None, 0)
    assert path.read_bytes() == before
    assert not (path.parent / "repaired").exists()
    return found.note


def cut(path: Path, whole: bytes, length: int) -> Path:
    path.write_bytes(whole[:length])
    return path


@pytest.mark.parametrize("kind", ["plain", "zstd", "lz4", "unchunked", "large"])
def test_wherever_a_file_is_cut_the_frames_before_it_are_saved(tmp_path: Path, kind: str) -> None:
    seen = frames(2, points=30_000) if kind == "large" else SEEN
    path = episode(tmp_path / "whole.mcap", seen)
    options: dict[str, Any] = {
        "zstd": {"compression": CompressionType.ZSTD, "chunk_size": 4000},
        "lz4": {"compression": CompressionType.LZ4, "chunk_size": 4000},
    }
    if kind in options:
        path = rewritten(path, tmp_path / "other.mcap", **options[kind])
    if kind == "unchunked":
        path = rewritten(path, tmp_path / "other.mcap", use_chunking=False)
    whole = path.read_bytes()
    records = places(whole)
    # Before the end of the data: all after it is index.
    data_end = next(place for opcode, place in records if opcode == Opcode.DATA_END)
    if kind == "unchunked":
        stamps = [place for opcode, place in records if opcode == Opcode.MESSAGE]
        # The last message of each frame is its `/frame`.
        channel = struct.unpack_from("<H", whole, stamps[-1] + 9)[0]
        ends = [
            place + 9 + HEADER.unpack_from(whole, place)[1]
            for place in stamps
            if struct.unpack_from("<H", whole, place + 9)[0] == channel
        ]
    else:
        ends = frame_ends(path)
    rng = np.random.default_rng(0)
    borders = [place for _, place in records]
    count = 15 if kind == "plain" else 5
    inside = rng.integers(9, len(whole), count).tolist()
    # All borders of the plain file, and some of each other.
    chosen = borders if kind == "plain" else rng.choice(borders, 8, replace=False).tolist()
    for length in {*chosen, *inside, 8, len(whole) - 1}:
        part = cut(tmp_path / "cut.mcap.part", whole, length)
        kept = sum(end <= length for end in ends)
        if kept:
            found = saved(part, seen[:kept], finished=length >= data_end)
            assert found.frames_lost == (0 if length >= data_end else None)
        else:
            assert "byte" in nothing(part)
    assert len(ends) == len(seen)


def test_a_file_that_lacks_its_index_alone_becomes_what_it_was(tmp_path: Path) -> None:
    camera = Camera(width=32, height=24)
    with_images = [with_image(one, camera) for one in frames(3, points=9000)]
    for name, write_it in {
        "recording": lambda path: write(path, with_images, camera=camera),
        "run": write_servo,
    }.items():
        path = write_it(tmp_path / f"{name}.mcap")
        whole = path.read_bytes()
        assert repair(path) == Repaired(
            path, "whole", None, len(EpisodeReader(path)), 0, len(whole), ""
        )
        for length in (len(whole), len(whole) - 1, len(whole) - FOOTER - 5):
            part = cut(tmp_path / f"{name}.mcap.part", whole, length)
            found = repair(part, tmp_path / f"{name}-{length}")
            assert found.saved is not None
            assert found.saved.read_bytes() == whole
            assert found.frames_lost == 0
            assert "complete but for its index" in found.note


def test_all_that_goes_with_the_frames_is_kept(tmp_path: Path) -> None:
    whole = write_servo(tmp_path / "run.mcap").read_bytes()
    with EpisodeReader(tmp_path / "run.mcap") as before:
        result = whole.index(b"dnet.result") - 4 - HEADER.size
        found = repair(cut(tmp_path / "run.mcap.part", whole, result))
        assert found.saved is not None
        with EpisodeReader(found.saved) as after:
            assert after.meta == before.meta
            assert after.steps() == before.steps()
            assert after.lines() == before.lines()
            assert after.attachments == before.attachments
            assert after.attachment("psm.urdf") == before.attachment("psm.urdf")
            np.testing.assert_array_equal(after.goal(), before.goal())
            assert not after.finished
    assert told(found.saved)["reason"] == f"byte {result}: it ends there without a result"


def test_calibration_and_attachments_of_any_name_stay_inside_the_file(tmp_path: Path) -> None:
    whole = episode(tmp_path / "data" / "a.mcap").read_bytes()
    part = cut(
        tmp_path / "data" / "a.mcap.part", whole, frame_ends(tmp_path / "data" / "a.mcap")[1]
    )
    found = repair(part)
    assert found.saved is not None
    with EpisodeReader(found.saved) as read:
        assert read.camera() is not None
        assert read.attachment("../../escape.txt") == b"text"
    files = {path.name for path in tmp_path.rglob("*") if path.is_file()}
    assert files == {"a.mcap", "a.mcap.part"}
    assert found.saved == tmp_path / "data" / "repaired" / "a.mcap"


def test_a_flipped_bit_keeps_the_frames_before_it(tmp_path: Path) -> None:
    path = episode(tmp_path / "a.mcap")
    whole = path.read_bytes()
    ends = frame_ends(path)
    for number in (1, 3):
        flipped = bytearray(whole)
        flipped[ends[number] - 200] ^= 4
        path.write_bytes(flipped)
        found = saved(path, SEEN[:number])
        assert "a chunk fails its checksum" in found.note
        # The index at the end is whole, and says how many there were.
        assert found.frames_lost == len(SEEN) - number


def test_a_broken_index_costs_no_frame(tmp_path: Path) -> None:
    path = episode(tmp_path / "a.mcap")
    content = bytearray(path.read_bytes())
    indexes = [place for opcode, place in places(content) if opcode == Opcode.MESSAGE_INDEX]
    content[indexes[3] + HEADER.size + 6 + 8] ^= 1
    path.write_bytes(content)
    assert "the data before it fails its checksum" in saved(path, SEEN).note


def test_an_interrupted_recording_loses_nothing(tmp_path: Path) -> None:
    with EpisodeWriter(tmp_path / "a.mcap", meta("a"), arms=ARMS, attachments={}) as writer:
        for one in SEEN[:2]:
            writer.add(one)
        writer.log("the disk is full", level="error")
    found = saved(writer.part, SEEN[:2])
    assert found.frames_lost == 0
    assert "without a result" in found.note


def test_a_recording_that_runs_is_saved_as_far_as_it_is(tmp_path: Path) -> None:
    with EpisodeWriter(tmp_path / "a.mcap", meta("a"), arms=ARMS, attachments={}) as writer:
        for index, one in enumerate(SEEN):
            writer.add(one)
            saved(writer.part, SEEN[: index + 1])
        writer.finish({})
    assert_same_frames(tmp_path / "a.mcap", SEEN)


def test_lines_after_the_last_whole_frame_are_kept_and_half_a_frame_is_not(tmp_path: Path) -> None:
    path = episode(tmp_path / "a.mcap")
    half = rewritten(
        path,
        tmp_path / "b.mcap.part",
        lambda topic, number, old: None if topic == "/frame" and number == 4 else old,
    )
    found = repair(half)
    assert found.saved is not None
    assert_same_frames(found.saved, SEEN[:4])
    assert told(found.saved)["dropped"] == 6
    with EpisodeReader(path) as before, EpisodeReader(found.saved) as after:
        assert after.lines() == before.lines()


@pytest.mark.parametrize(
    ("topic", "content", "why"),
    [
        ("/tf", None, "frame 2 lacks /tf"),
        ("/frame", b"{", "the end of frame 2 is unreadable"),
        ("/frame", b'{"index": 1, "kind": "way", "time": 0}', "frame 2 says that it is number 1"),
        ("/frame", b"[" * 100_000, "the end of frame 2 is unreadable"),
        ("/frame", None, "frame 2 has a second message on /cloud/current"),
    ],
)
def test_a_frame_that_is_not_whole_ends_the_episode(
    tmp_path: Path, topic: str, content: bytes | None, why: str
) -> None:
    source = episode(tmp_path / "a.mcap")
    spoiled = rewritten(
        source,
        tmp_path / "b.mcap.part",
        lambda name, number, old: content if (name, number) == (topic, 2) else old,
    )
    assert why in saved(spoiled, SEEN[:2]).note


def test_a_spoiled_attachment_is_left_out(tmp_path: Path) -> None:
    path = episode(tmp_path / "a.mcap")
    content = bytearray(path.read_bytes())
    content[content.index(b"<robot/>") + 3] ^= 1
    part = cut(tmp_path / "a.mcap.part", bytes(content), len(content) - 1)
    found = repair(part)
    assert found.saved is not None
    assert_same_frames(found.saved, SEEN)
    with EpisodeReader(found.saved) as read:
        assert read.attachments == ("../../escape.txt",)
        assert not read.finished
    assert "1 attachments that fail their checksum are left out" in found.note


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", "byte 0: it does not begin as an MCAP file does"),
        (b"\x89MCAP", "byte 0: it does not begin as an MCAP file does"),
        (b"RRF2 and so on", "byte 0: it does not begin as an MCAP file does"),
        (b"\x89MCAP0\r\n", "no metadata `dnet.episode`; byte 8: it ends there"),
        (b"\x89MCAP0\r\n" + bytes(5000), "byte 8: no record begins there"),
        (b"\x89MCAP0\r\n\x01" + b"\xff" * 8, "byte 8: a record is cut off"),
        (b"\x89MCAP0\r\n" + b"garbage after the beginning", "byte 8: a record is cut off"),
    ],
)
def test_a_file_without_a_frame_leaves_nothing_behind(
    tmp_path: Path, content: bytes, why: str
) -> None:
    path = tmp_path / "a.mcap.part"
    path.write_bytes(content)
    assert why in nothing(path)


def test_an_episode_without_its_description_is_not_saved(tmp_path: Path) -> None:
    path = episode(tmp_path / "a.mcap")
    content = path.read_bytes()
    (tmp_path / "b.mcap").write_bytes(content.replace(b"dnet.episode", b"dnet.somehow"))
    assert "no metadata `dnet.episode`" in nothing(tmp_path / "b.mcap")
    (tmp_path / "b.mcap").write_bytes(content.replace(b"schema_version", b"schema_varsion"))
    assert "schema version missing" in nothing(tmp_path / "b.mcap")
    assert "no whole frame" in nothing(cut(tmp_path / "b.mcap", content, 2000))


def hostile(path: Path, *records: tuple[int, bytes], after: bytes = b"") -> Path:
    """Put records before the frames of an episode, with no checksum of the whole to tell."""
    source = path.with_name("whole.mcap")
    whole = (source if source.exists() else episode(source)).read_bytes()
    place = next(place for opcode, place in places(whole) if opcode == Opcode.CHUNK)
    put = b"".join(HEADER.pack(opcode, len(content)) + content for opcode, content in records)
    path.write_bytes(whole[:place] + put + after + whole[place : len(whole) - FOOTER])
    return path


def test_records_of_others_are_passed_over(tmp_path: Path) -> None:
    path = hostile(tmp_path / "a.mcap.part", (0x80, b"private"), (0x7F, b""))
    assert saved(path, SEEN).frames_lost is None


def chunk_record(content: bytes, *, size: int | None = None, compression: bytes = b"") -> bytes:
    length = len(content) if size is None else size
    head = struct.pack("<QQQII", 0, 0, length, 0, len(compression)) + compression
    return head + struct.pack("<Q", len(content)) + content


@pytest.mark.parametrize(
    ("record", "why"),
    [
        ((Opcode.MESSAGE, b"short"), "unpack"),
        ((Opcode.MESSAGE, struct.pack("<HIQQ", 999, 0, 0, 0)), "channel 999, which was not"),
        ((Opcode.MESSAGE, struct.pack("<HIQQ", 1, 0, 2**64 - 1, 0)), "later than any can be"),
        ((Opcode.CHANNEL, struct.pack("<HH", 1, 77) + bytes(12)), "schema 77, which was not"),
        ((Opcode.SCHEMA, struct.pack("<HIII", 1, 0, 0, 2**31)), "byte"),
        ((Opcode.SCHEMA, struct.pack("<HI", 1, 2**31)), "byte"),
        ((Opcode.METADATA, struct.pack("<II", 0, 2**31)), "byte"),
        ((Opcode.METADATA, struct.pack("<I", 2) + b"\xff\xfe" + bytes(4)), "decode"),
        ((Opcode.ATTACHMENT, b"x"), "unpack"),
        ((Opcode.ATTACHMENT, struct.pack("<QQIIQI", 0, 0, 0, 0, 2**60, 0)), "byte"),
        ((Opcode.CHUNK, b""), "a chunk is unreadable"),
        ((Opcode.CHUNK, chunk_record(b"abc")), "a chunk holds what is no record"),
        ((Opcode.CHUNK, chunk_record(HEADER.pack(5, 2**63))), "a chunk holds what is no record"),
        ((Opcode.CHUNK, chunk_record(b"", size=2**40, compression=b"zstd")), "at most"),
        ((Opcode.CHUNK, chunk_record(b"", compression=b"rar")), "only zstd and lz4"),
    ],
)
def test_no_record_is_obeyed_that_is_not_what_it_says(
    tmp_path: Path, record: tuple[int, bytes], why: str
) -> None:
    assert why in nothing(hostile(tmp_path / "a.mcap.part", record))


def test_a_record_of_any_length_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap.part"
    with path.open("wb") as file:
        file.write(b"\x89MCAP0\r\n" + HEADER.pack(0x80, LARGEST_RECORD + 1))
        # A hole: it takes no room on the disk.
        file.truncate(2 * LARGEST_RECORD)
    with pytest.raises(BrokenRecord, match="more than is believed"):
        list(read_records(path))


def test_what_stays_in_memory_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    schema = struct.pack("<HI", 9, 0) + struct.pack("<II", 0, 50) + bytes(50)
    channel = struct.pack("<HHI", 900, 0, 4) + b"/tfs" + bytes(8)
    message = struct.pack("<HIQQ", 900, 0, 0, 0) + bytes(50)
    metadata = (Opcode.METADATA, struct.pack("<II", 0, 0))
    monkeypatch.setattr(raw_copy, "MOST_BESIDE", 30)
    assert "more than 30 schemas" in nothing(hostile(tmp_path / "a.mcap.part", *[metadata] * 30))
    monkeypatch.setattr(raw_copy, "LARGEST_CHUNK", 100)
    many = [(int(Opcode.SCHEMA), schema)] * 3
    assert "of more than 100 bytes" in nothing(hostile(tmp_path / "a.mcap.part", *many))
    monkeypatch.undo()
    monkeypatch.setattr(whole_frames, "LARGEST_FRAME", 2000)
    beside = (int(Opcode.MESSAGE), message)
    framed = struct.pack("<HHI", 901, 0, 3) + b"/tf" + bytes(8)
    start = (int(Opcode.MESSAGE), struct.pack("<HIQQ", 901, 0, 0, 0))
    described = [(int(Opcode.CHANNEL), channel), (int(Opcode.CHANNEL), framed)]
    path = hostile(tmp_path / "a.mcap.part", *described, start, *[beside] * 8)
    assert "frame 0 has no end within 2000 bytes" in nothing(path)


def test_a_bomb_does_not_fill_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = episode(tmp_path / "a.mcap")
    big = rewritten(
        path,
        tmp_path / "b.mcap.part",
        lambda topic, _, old: bytes(500_000) if topic == "/log" else old,
        compression=CompressionType.ZSTD,
        chunk_size=1000,
    )
    assert big.stat().st_size < 50_000
    monkeypatch.setattr(whole_frames, "LARGEST_GROWTH", 10)
    monkeypatch.setattr(whole_frames, "LARGEST_CHUNK", 1000)
    assert "it unpacks to more than 10 times its size" in nothing(big)
    assert LARGEST_CHUNK == 64 * 2**20


def test_a_frame_on_a_second_channel_is_none(tmp_path: Path) -> None:
    path = rewritten(episode(tmp_path / "a.mcap"), tmp_path / "b.mcap", use_chunking=False)
    content = bytearray(path.read_bytes())
    channels = [place for opcode, place in places(content) if opcode == Opcode.CHANNEL]
    first = next(place for place in channels if b"/tf" in content[place : place + 40])
    (length,) = struct.unpack_from("<Q", content, first + 1)
    channel = bytearray(content[first : first + HEADER.size + length])
    (number,) = struct.unpack_from("<H", channel, HEADER.size)
    struct.pack_into("<H", channel, HEADER.size, 500)
    # The fourth frame's transforms come on the other channel of that topic.
    messages = [
        place
        for opcode, place in places(content)
        if opcode == Opcode.MESSAGE and struct.unpack_from("<H", content, place + 9)[0] == number
    ]
    struct.pack_into("<H", content, messages[3] + HEADER.size, 500)
    spoiled = tmp_path / "c.mcap.part"
    spoiled.write_bytes(content[:first] + channel + content[first : len(content) - FOOTER])
    assert "frame 3 is on a second channel of /tf" in saved(spoiled, SEEN[:3]).note


@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_no_spoiled_bytes_break_more_than_the_episode(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    """Whatever is saved is a beginning of the episode; anything but a refusal fails the test."""
    folder = tmp_path_factory.mktemp("spoiled")
    chunked = data.draw(st.booleans())
    path = rewritten(
        episode(folder / "a.mcap", SEEN[:2]),
        folder / "b.mcap.part",
        compression=data.draw(st.sampled_from([CompressionType.NONE, CompressionType.ZSTD])),
        chunk_size=3000,
        use_chunking=chunked,
    )
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 3))):
        place = data.draw(st.integers(8, len(content) - 9))
        content[place] = data.draw(st.sampled_from([0, 1, 127, 128, 255]))
    path.write_bytes(content)
    found = repair(path)
    assert path.read_bytes() == content
    if found.saved is None:
        assert not (folder / "repaired").exists()
    elif chunked:
        assert_same_frames(found.saved, SEEN[: found.frames_kept])
    else:
        # Messages outside chunks have no checksum: what they say may be spoiled.
        with EpisodeReader(found.saved) as read:
            assert len(read) == found.frames_kept


@pytest.fixture
def recorder() -> Iterator["subprocess.Popen[str]"]:
    """Records into each path that it is told, until the recording is killed."""
    root = Path(__file__).parents[2]
    with subprocess.Popen(
        [sys.executable, "-m", "tests.tools.killed_recording"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
        bufsize=1,
        cwd=root,
        env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
    ) as process:
        yield process
        assert process.stdin is not None
        process.stdin.close()


def killed(recorder: "subprocess.Popen[str]", path: Path, *, after: int, delay: float) -> int:
    """Kill a recording some time after a frame was in; return how many were when it died."""
    assert recorder.stdin is not None
    assert recorder.stdout is not None
    print(path, file=recorder.stdin, flush=True)
    number = int(recorder.stdout.readline())
    counted = 0
    while counted < after:
        counted = int(recorder.stdout.readline())
    time.sleep(delay)
    os.kill(number, signal.SIGKILL)
    while (line := recorder.stdout.readline().strip()) != "gone":
        counted = int(line)
    return counted


def test_a_killed_recording_comes_back_with_every_frame_that_was_in(
    tmp_path: Path, recorder: "subprocess.Popen[str]"
) -> None:
    rng = np.random.default_rng(0)
    counts = []
    for number in range(50):
        large = number % 3 == 0
        path = tmp_path / (f"{number}-large.mcap" if large else f"{number}.mcap")
        after, delay = int(rng.integers(0, 6)), float(rng.uniform(0, 0.006))
        counts.append(killed(recorder, path, after=after, delay=delay))
        part = path.with_name(f"{path.name}.part")
        if not counts[-1] and not part.exists():
            continue
        found = repair(part)
        # One more may be in of which the process had no time to tell.
        assert counts[-1] <= found.frames_kept <= counts[-1] + 1
        assert not path.exists()
        if found.saved is not None:
            seen = [recorded(index, large=large) for index in range(found.frames_kept)]
            assert_same_frames(found.saved, seen)
            found.saved.unlink()
        part.unlink()
    assert len(set(counts)) > 5


def test_a_directory_is_repaired_file_by_file(tmp_path: Path) -> None:
    data = tmp_path / "data"
    whole = episode(data / "whole.mcap").read_bytes()
    end = frame_ends(data / "whole.mcap")[2]
    cut(data / "cut.mcap", whole, end + 3)
    cut(data / "killed.mcap.part", whole, end)
    (data / "other.mcap").write_bytes(b"something else")
    damaged = bytearray(whole)
    damaged[end - 200] ^= 1
    (data / "damaged.mcap").write_bytes(damaged)
    before = {path: path.read_bytes() for path in data.iterdir()}
    calls: list[tuple[int, int]] = []
    rows = repair_directory(data, on_file=lambda done, total: calls.append((done, total)))
    found = {one.file.name: (one.outcome, one.frames_kept, one.frames_lost) for one in rows}
    assert found == {
        "cut.mcap": ("saved", 3, None),
        "damaged.mcap": ("saved", 2, 3),
        "killed.mcap.part": ("saved", 3, None),
        "other.mcap": ("nothing to save", 0, None),
        "whole.mcap": ("whole", 5, 0),
    }
    assert calls == [(number, 5) for number in range(1, 6)]
    assert {path: path.read_bytes() for path in before} == before
    names = sorted(path.name for path in (data / "repaired").iterdir())
    assert names == ["cut.mcap", "damaged.mcap", "killed.mcap"]
    # A second call replaces nothing, and saves what is new.
    kept = {path: path.read_bytes() for path in (data / "repaired").iterdir()}
    cut(data / "late.mcap.part", whole, end)
    again = {one.file.name: one.outcome for one in repair_directory(data)}
    assert again == dict.fromkeys(("cut.mcap", "damaged.mcap", "killed.mcap.part"), "occupied") | {
        "late.mcap.part": "saved", "other.mcap": "nothing to save", "whole.mcap": "whole"
    }  # fmt: skip
    assert {path: path.read_bytes() for path in kept} == kept


def test_two_files_of_one_name_do_not_replace_each_other(tmp_path: Path) -> None:
    whole = episode(tmp_path / "whole.mcap").read_bytes()
    ends = frame_ends(tmp_path / "whole.mcap")
    cut(tmp_path / "a.mcap", whole, ends[3])
    cut(tmp_path / "a.mcap.part", whole, ends[1])
    outcomes = [one.outcome for one in repair_directory(tmp_path)]
    assert outcomes == ["saved", "occupied", "whole"]
    assert_same_frames(tmp_path / "repaired" / "a.mcap", SEEN[:4])


def test_nothing_is_written_over(tmp_path: Path) -> None:
    whole = episode(tmp_path / "whole.mcap").read_bytes()
    part = cut(tmp_path / "a.mcap.part", whole, frame_ends(tmp_path / "whole.mcap")[1])
    with pytest.raises(SharedFolder, match="which stay as they are"):
        repair(part, tmp_path / "." / ".." / tmp_path.name)
    out = tmp_path / "out"
    out.mkdir()
    for name, holds in {"a.mcap": "an episode", "a.mcap.part": "an unfinished episode"}.items():
        (out / name).write_bytes(b"precious")
        with pytest.raises(OccupiedOutput, match=f"{name} already holds {holds}"):
            repair(part, out)
        assert (out / name).read_bytes() == b"precious"
        (out / name).unlink()
    assert part.read_bytes() == whole[: len(part.read_bytes())]


def test_a_folder_that_cannot_be_written_is_named(tmp_path: Path) -> None:
    whole = episode(tmp_path / "whole.mcap").read_bytes()
    part = cut(tmp_path / "a.mcap.part", whole, frame_ends(tmp_path / "whole.mcap")[1])
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(Unwritten, match=r"nothing can be written into .*file: File exists"):
        repair(part, tmp_path / "file")


def test_what_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MissingPath, match="nowhere"):
        repair(tmp_path / "nowhere.mcap")
    with pytest.raises(MissingPath, match="nowhere"):
        repair_directory(tmp_path / "nowhere")
    with pytest.raises(NoEpisodes):
        repair_directory(tmp_path)


def run(*arguments: str | Path) -> None:
    tyro.cli(Repair, args=[str(argument) for argument in arguments]).run()


def test_the_command_prints_a_row_a_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = episode(tmp_path / "a.mcap").read_bytes()
    cut(tmp_path / "b.mcap.part", whole, frame_ends(tmp_path / "a.mcap")[1])
    run(tmp_path, "--out", tmp_path / "saved")
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert lines[0] == ["file", "outcome", "kept", "lost", "MB", "note"]
    assert lines[1][:4] == ["a.mcap", "whole", "5", "0"]
    assert lines[2][:4] == ["b.mcap.part", "saved", "2", "-"]
    assert lines[3] == ["1", "whole,", "1", "saved;", "saved", "into", str(tmp_path / "saved")]
    with pytest.raises(OccupiedOutput, match=r"saved before of b\.mcap\.part"):
        run(tmp_path, "--out", tmp_path / "saved")


def test_the_command_fails_where_nothing_is_saved_after_it_saved_the_rest(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = episode(tmp_path / "whole.mcap").read_bytes()
    (tmp_path / "a.mcap").write_bytes(b"something else")
    cut(tmp_path / "b.mcap.part", whole, frame_ends(tmp_path / "whole.mcap")[1])
    with pytest.raises(NothingSaved, match=r"of 1 of 3 files \(a\.mcap\)"):
        run(tmp_path, "--json")
    files = json.loads(capsys.readouterr().out)["files"]
    assert [one["outcome"] for one in files] == ["nothing to save", "saved", "whole"]
    assert files[1] | {"note": "", "bytes_kept": 0} == {
        "file": str(tmp_path / "b.mcap.part"),
        "outcome": "saved",
        "saved": str(tmp_path / "repaired" / "b.mcap"),
        "frames_kept": 2,
        "frames_lost": None,
        "bytes_kept": 0,
        "note": "",
    }
    with pytest.raises(NothingSaved):
        run(tmp_path / "a.mcap")
