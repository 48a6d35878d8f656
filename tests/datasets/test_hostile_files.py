"""Files that are cut, spoiled or made to do harm: refused or reported, never obeyed."""

import struct
import tracemalloc
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from time import process_time

import lz4.frame
import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.writer import CompressionType

from dnet.datasets import messages
from dnet.datasets.chunk import decompress
from dnet.datasets.mcap_file import McapFile
from dnet.datasets.point_cloud import MOST_FIELDS, NotFinite, read_point_cloud
from dnet.datasets.reader import FRAME_TOPICS, EpisodeReader
from dnet.datasets.summary import MOST_NAMES
from dnet.errors import BadEpisode, DnetError
from dnet.geometry.camera import Camera
from dnet.recorders.episode import EpisodeWriter
from dnet.recorders.messages import frame_transforms, point_cloud
from dnet.tools.validate import validate
from dnet.tools.validate_container import MOST_DESCRIPTIONS
from dnet.types import Frame, Transform
from tests.datasets.surgery import Message, mend, only, packed, records, rewrite, with_summary
from tests.recorders.rollout import ARMS, GRASP, HOLDING, frames, meta, with_image, write

MOVING = ARMS.placement.joints_at(1, GRASP)
BEYOND = (2**63, 2**64 - 1)
MEGABYTE = 2**20


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("source") / "a.mcap", frames(2, points=4))


@pytest.fixture(scope="module")
def packings(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    """An episode with images, its chunks compressed in each of the ways there are."""
    camera = Camera(width=4, height=3)
    seen = [with_image(one, camera) for one in frames(2, points=4)]
    source = write(tmp_path_factory.mktemp("source") / "a.mcap", seen, camera=camera)
    found = {"plain": source.read_bytes()}
    for kind in (CompressionType.ZSTD, CompressionType.LZ4):
        path = source.with_name(f"{kind.name}.mcap")
        found[kind.name] = rewrite(source, path, compression=kind).read_bytes()
    return found


def read_all(path: Path) -> int:
    """Read everything that there is in a file; return how many frames it has."""
    with EpisodeReader(path) as episode:
        for index in range(len(episode)):
            episode.frame(index)
            episode.transforms(index)
        for read in (episode.camera, episode.goal, episode.steps, episode.lines):
            read()
        for name in episode.attachments:
            episode.attachment(name)
        return len(episode) + len(episode.grasps)


def reported(path: Path) -> bool:
    """Read and validate a file, of which anything but a refusal fails the test."""
    with suppress(DnetError):
        read_all(path)
    return bool(validate([path]).findings)


def put(new: bytes, _old: bytes) -> bytes:
    return new


@contextmanager
def little_memory(most: int) -> Iterator[None]:
    tracemalloc.start()
    try:
        yield
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < most


@contextmanager
def little_time(most: float) -> Iterator[None]:
    start = process_time()
    yield
    assert process_time() - start < most


@pytest.mark.parametrize(("packing", "count"), [("plain", 45), ("ZSTD", 20), ("LZ4", 20)])
def test_every_flipped_bit_is_reported(
    tmp_path: Path, packings: dict[str, bytes], packing: str, count: int
) -> None:
    """Each byte of a file is covered by a checksum, or is one, or is where one must be."""
    rng = np.random.default_rng(0)
    whole, path = packings[packing], tmp_path / "a.mcap"
    # At random, and where it does the most: in the heads of records.
    heads = [one.start + int(rng.integers(9)) for one in records(whole)]
    some = rng.choice(heads, count // 3, replace=False)
    for place in (*some.tolist(), *rng.integers(len(whole), size=count).tolist()):
        content = bytearray(whole)
        content[place] ^= 1 << int(rng.integers(8))
        path.write_bytes(content)
        assert reported(path), f"byte {place} of {len(whole)}"


@pytest.mark.parametrize(("packing", "count"), [("plain", 50), ("ZSTD", 15), ("LZ4", 15)])
def test_spoiled_bytes_that_no_checksum_tells_of_do_no_harm(
    tmp_path: Path, packings: dict[str, bytes], packing: str, count: int
) -> None:
    rng = np.random.default_rng(1)
    # Not in the attachments, which are half of the file and are only bytes.
    whole, path = bytearray(packings[packing]), tmp_path / "a.mcap"
    attached = {
        place
        for one in records(whole)
        if one.opcode == Opcode.ATTACHMENT
        for place in range(one.start + 80, one.end)
    }
    places = [place for place in range(8, len(whole) - 8) if place not in attached]
    mend(whole, crc=lambda _content: 0)
    for _ in range(count):
        content = whole.copy()
        for place in rng.choice(places, int(rng.integers(1, 5))).tolist():
            content[place] = int(rng.choice([0, 1, 127, 128, 255]))
        path.write_bytes(content)
        reported(path)


def test_a_file_cut_at_any_record_is_reported(tmp_path: Path, source: Path) -> None:
    whole, path = source.read_bytes(), tmp_path / "a.mcap"
    for one in records(whole):
        for end in (one.start, one.start + 5, one.start + 9):
            path.write_bytes(whole[:end])
            with pytest.raises(BadEpisode):
                EpisodeReader(path)
        (finding,) = validate([path]).findings
        assert (finding.severity, finding.check) == ("error", "unreadable")


def test_a_message_of_another_topic_is_reported(tmp_path: Path, source: Path) -> None:
    contents: dict[str, bytes] = {}

    def note(one: Message) -> list[Message]:
        contents[one.topic] = one.content
        return [one]

    rewrite(source, tmp_path / "copy.mcap", note)
    path, pairs = tmp_path / "a.mcap", 0
    for topic in FRAME_TOPICS:
        for other, content in contents.items():
            # A cloud of nodes in place of one of the surface is a cloud of another size.
            if other != topic:
                rewrite(source, path, only(topic, 1, partial(put, content)))
                assert reported(path), f"{other} in {topic}"
                pairs += 1
    assert pairs == 7 * 7


def chunk(compression: str, size: int, content: bytes) -> memoryview:
    name = compression.encode()
    head = struct.pack("<QQQII", 0, 0, size, 0, len(name)) + name + struct.pack("<Q", len(content))
    return memoryview(packed(Opcode.CHUNK, head + content))


COMPRESS: dict[str, Callable[[bytes], bytes]] = {
    "zstd": zstandard.ZstdCompressor(level=19).compress,
    "lz4": lz4.frame.compress,
}


@pytest.mark.parametrize("compression", COMPRESS)
@pytest.mark.parametrize("size", [0, 100, MEGABYTE - 1, *BEYOND])
def test_a_bomb_is_not_inflated(compression: str, size: int) -> None:
    bomb = chunk(compression, size, COMPRESS[compression](bytes(32 * MEGABYTE)))
    with little_memory(4 * MEGABYTE), pytest.raises(ValueError, match=f"{size} "):
        decompress(bomb)


def test_a_zstd_frame_that_asks_for_a_huge_window_is_refused() -> None:
    # RFC 8878: magic, a head without a size, and a window of 2^41 bytes.
    frame = bytes.fromhex("28b52ffd 00 f8 010000")
    with little_memory(MEGABYTE), pytest.raises(ValueError, match="too much memory"):
        decompress(chunk("zstd", 100, frame))


def test_a_compression_of_any_name_is_named_in_short() -> None:
    with pytest.raises(ValueError, match="compression 'xxx") as caught:
        decompress(chunk("x" * MEGABYTE, 0, b""))
    assert len(str(caught.value)) < 200


@pytest.mark.parametrize("length", BEYOND)
def test_a_length_beyond_the_file_is_reported(tmp_path: Path, source: Path, length: int) -> None:
    """In the head of every kind of record, and in every field of eight bytes of some."""
    whole, path = bytearray(source.read_bytes()), tmp_path / "a.mcap"
    kinds = {one.opcode: one for one in records(whole)}
    places = [one.start + 1 for one in kinds.values()]
    for opcode, offsets in {
        Opcode.CHUNK: (16, 32),
        Opcode.CHUNK_INDEX: (16, 24),
        Opcode.ATTACHMENT_INDEX: (0, 8),
        Opcode.METADATA_INDEX: (0, 8),
        Opcode.MESSAGE_INDEX: (14,),
        Opcode.ATTACHMENT: (16 + 4 + len("config.json") + 4 + len("application/json"),),
        Opcode.FOOTER: (0,),
        Opcode.STATISTICS: (0,),
    }.items():
        places += [kinds[opcode].start + 9 + offset for offset in offsets]
    mend(whole, crc=lambda _content: 0)
    for place in places:
        content = whole.copy()
        struct.pack_into("<Q", content, place, length)
        path.write_bytes(content)
        with little_memory(8 * MEGABYTE), suppress(DnetError):
            read_all(path)
        assert validate([path]).errors, f"byte {place}"


def channel(number: int, topic: str) -> bytes:
    name = topic.encode()
    body = struct.pack("<HHI", number, 0, len(name)) + name + bytes(8)
    return packed(Opcode.CHANNEL, body)


def index(opcode: int, name: str) -> bytes:
    text = name.encode()
    fields = bytes(40 if opcode == Opcode.ATTACHMENT_INDEX else 16)
    return packed(opcode, fields + struct.pack("<I", len(text)) + text + bytes(4))


@pytest.mark.parametrize("kind", ["channels", "attachments", "metadata records"])
def test_a_million_names_in_the_summary_are_refused(
    tmp_path: Path, source: Path, kind: str
) -> None:
    make: dict[str, Callable[[int], bytes]] = {
        "channels": lambda number: channel(number & 0xFFFF, f"/{number}"),
        "attachments": lambda number: index(Opcode.ATTACHMENT_INDEX, str(number)),
        "metadata records": lambda number: index(Opcode.METADATA_INDEX, str(number)),
    }
    # What is refused is refused at the first that are too many: the others need not differ.
    extra = b"".join(map(make[kind], range(MOST_NAMES))) + make[kind](0) * (10**6 - MOST_NAMES)
    path = tmp_path / "a.mcap"
    path.write_bytes(with_summary(source.read_bytes(), extra))
    with (
        little_time(2.0),
        little_memory(8 * MEGABYTE),
        pytest.raises(BadEpisode, match=f"more than {MOST_NAMES} {kind}"),
    ):
        McapFile(path)
    with little_time(2.0):
        assert [one.check for one in validate([path]).findings] == ["unreadable"]


def with_chunk(source: bytes, records_: bytes, *, messages_: int = 0) -> bytes:
    """Put a compressed chunk before the end of the data, with an index if it is to have one."""
    end = next(one.start for one in records(source) if one.opcode == Opcode.DATA_END)
    made = bytes(chunk("zstd", len(records_), COMPRESS["zstd"](records_)))
    if messages_:
        entries = struct.pack("<QQ", 0, 0) * messages_
        made += packed(Opcode.MESSAGE_INDEX, struct.pack("<HI", 1, len(entries)) + entries)
    content = bytearray(source[:end] + made + source[end:])
    footer = records(content)[-1].start + 9
    (start,) = struct.unpack_from("<Q", content, footer)
    struct.pack_into("<Q", content, footer, start + len(made))
    return mend(content, crc=lambda _content: 0)


@pytest.mark.parametrize(
    "record",
    [
        packed(Opcode.MESSAGE, struct.pack("<HIQQ", 1, 0, 0, 0)),
        channel(9999, "/more"),
        packed(0x7F, b""),
    ],
)
def test_a_chunk_of_more_records_than_a_file_can_need_is_not_read_to_its_end(
    tmp_path: Path, source: Path, record: bytes
) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(with_chunk(source.read_bytes(), record * (2 * MOST_DESCRIPTIONS)))
    assert path.stat().st_size < 2 * len(source.read_bytes())
    with little_time(6.0):
        found = validate([path]).findings
    assert any("reading chunk 3 stops at byte" in one.what for one in found)


def test_chunks_that_inflate_to_many_times_the_file_are_not_all_read(
    tmp_path: Path, source: Path
) -> None:
    content, path = source.read_bytes(), tmp_path / "a.mcap"
    record = packed(0x7F, bytes(48 * MEGABYTE))
    for _ in range(3):
        content = with_chunk(content, record)
    path.write_bytes(content)
    found = validate([path]).findings
    assert any("its chunks decompress to more than" in one.what for one in found)


@pytest.mark.parametrize(
    ("read", "message"),
    [
        (read_point_cloud, b"\x0a\x00" * (8 * MEGABYTE)),
        (read_point_cloud, b"\x2a\x00" * (8 * MEGABYTE)),
        (messages.read_transforms, b"\x0a\x00" * (8 * MEGABYTE)),
        (messages.read_transforms, b"\x0a\x00" * 30_000),
        (messages.read_joints, b"\x12\x00" * (8 * MEGABYTE)),
        (messages.read_joints, b"\x12\x00" * 30_000),
        (messages.read_calibration, b"\x2a\x00" * (8 * MEGABYTE)),
        (messages.read_frame_end, b"[" * (8 * MEGABYTE)),
        (messages.read_frame_end, b"[" * 60_000),
        (messages.read_step, b"[" + b"[]," * (4 * MEGABYTE) + b"[]]"),
    ],
)
def test_a_message_of_millions_of_parts_takes_no_memory(
    read: Callable[[memoryview], object], message: bytes
) -> None:
    view = memoryview(message)
    with little_time(0.5), little_memory(4 * MEGABYTE), pytest.raises(messages.UNREADABLE):
        read(view)


def test_a_cloud_has_as_many_fields_as_clouds_have() -> None:
    cloud = point_cloud(np.zeros((2, 3), np.float32), 0).SerializeToString()
    assert len(read_point_cloud(memoryview(b"\x0a\x00" * 200 + cloud))) == 2
    with pytest.raises(ValueError, match=f"more than {MOST_FIELDS} fields"):
        read_point_cloud(memoryview(b"\x0a\x00" * (MOST_FIELDS + 1)))


@pytest.mark.parametrize("rotation", [[1e200, 0, 0, 1], [0, 0, 0, 0], [np.inf, 0, 0, 1]])
def test_a_camera_that_is_turned_by_no_rotation_is_refused(rotation: list[float]) -> None:
    entry = Transform("world", "camera", np.zeros(3), np.array(rotation, float))
    message = frame_transforms([entry], 0).SerializeToString()
    with pytest.raises(ValueError, match="a quaternion of length"):
        messages.read_pose(memoryview(message), frame="camera")


@pytest.mark.parametrize(
    ("record", "error"),
    [
        (b'{"index": 1.5, "kind": "way", "time": 0}', TypeError),
        (b'{"index": true, "kind": "way", "time": 0}', TypeError),
        (b'{"index": 1, "kind": "way", "time": Infinity}', NotFinite),
    ],
)
def test_a_frame_has_a_whole_number_and_a_time(record: bytes, error: type[Exception]) -> None:
    with pytest.raises(error):
        messages.read_frame_end(memoryview(record))


NAMES = ("../../x", "/etc/dnet-x", "a\0b", "n" * 10_000, "\x1b[2J", "", ".", "\u202e", "con/../x")


def test_attachments_of_any_name_are_only_bytes(tmp_path: Path, source: Path) -> None:
    directory = tmp_path / "deep" / "data"
    directory.mkdir(parents=True)
    attached = {name: f"content {number}".encode() for number, name in enumerate(NAMES)}
    path = rewrite(source, directory / "a.mcap", attachments=attached)
    before = path.read_bytes()
    with EpisodeReader(path) as episode:
        for name, content in attached.items():
            assert episode.attachment(name) == content
    assert validate([directory]).findings == ()
    spoiled = bytearray(before)
    for content in attached.values():
        spoiled[before.index(content)] ^= 1
    path.write_bytes(spoiled)
    found = [one for one in validate([directory]).findings if "checksum" in one.check]
    assert found
    assert all(one.what.isprintable() and len(one.what) < 1000 for one in found)
    assert [one.relative_to(tmp_path) for one in sorted(tmp_path.rglob("*"))] == [
        Path("deep"), Path("deep/data"), Path("deep/data/a.mcap")
    ]  # fmt: skip
    assert not Path("/etc/dnet-x").exists()


coordinates = st.floats(-1e3, 1e3, width=32)


@st.composite
def seen(draw: st.DrawFn) -> list[Frame]:
    """Frames of any clouds, kinds and grasps, at times that do not run backwards."""
    seed = draw(st.integers(0, 2**32 - 1))
    rng = np.random.default_rng(seed)
    times = sorted(draw(st.lists(st.floats(0, 1e6), max_size=4)))
    return [
        Frame(
            time=time,
            kind=draw(st.sampled_from(["rest", "shape", "way"])),
            cloud=rng.normal(size=(draw(st.integers(1, 64)), 3)).astype(np.float32),
            grasp=np.array(draw(st.tuples(*3 * [st.floats(-1e3, 1e3)]))),
            joints=(HOLDING, MOVING + rng.normal(scale=0.01, size=6)),
            nodes=rng.normal(size=(draw(st.integers(1, 64)), 3)).astype(np.float32),
        )
        for time in times
    ]


@settings(max_examples=25, deadline=None, derandomize=True)
@given(wanted=seen())
def test_any_frames_come_back_bit_by_bit(
    tmp_path_factory: pytest.TempPathFactory, wanted: list[Frame]
) -> None:
    path = tmp_path_factory.mktemp("any") / "a.mcap"
    with EpisodeWriter(path, meta("a"), arms=ARMS, attachments={}) as writer:
        for one in wanted:
            writer.add(one)
        writer.finish({"frames": len(wanted)})
    with EpisodeReader(path) as episode:
        assert len(episode) == len(wanted)
        for number, one in enumerate(wanted):
            read = episode.frame(number)
            assert (read.time, read.kind) == (one.time, one.kind)
            for got, written in (
                (read.cloud, one.cloud),
                (read.nodes, one.nodes),
                (read.grasp, one.grasp),
                (read.joints[0], one.joints[0]),
                (read.joints[1], one.joints[1]),
            ):
                assert (got.dtype, got.shape) == (written.dtype, written.shape)
                assert got.tobytes() == written.tobytes()
    ours = {"points", "units", "frame-kind", "frame-count"}
    assert {one.check for one in validate([path]).findings} <= ours


def test_an_index_that_leads_to_another_topic_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", frames(2))
    content = bytearray(path.read_bytes())
    entries = [one.start + 9 + 36 for one in records(content) if one.opcode == Opcode.CHUNK_INDEX]
    # Of the first chunk with frames: where its first two channels' message indexes are.
    for first in entries:
        one, other = slice(first + 2, first + 10), slice(first + 12, first + 20)
        content[one], content[other] = content[other], content[one]
    path.write_bytes(mend(content))
    with pytest.raises(BadEpisode, match="message index of its chunk"):
        EpisodeReader(path)
