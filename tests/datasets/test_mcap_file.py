import struct
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from dnet.datasets.chunk import LARGEST_CHUNK
from dnet.datasets.mcap_file import McapFile
from dnet.errors import BadEpisode, MissingPath

COMPRESSIONS = [CompressionType.NONE, CompressionType.LZ4, CompressionType.ZSTD]


def write(
    path: Path,
    messages: Sequence[tuple[str, int, bytes]],
    *,
    compression: CompressionType = CompressionType.NONE,
    chunk_size: int = 200,
    indexes: IndexType = IndexType.ALL,
    chunked: bool = True,
) -> Path:
    """Write topic, log time and content of each message with the stock writer."""
    with path.open("wb") as file:
        writer = Writer(
            file,
            chunk_size=chunk_size,
            compression=compression,
            index_types=indexes,
            use_chunking=chunked,
        )
        writer.start()
        writer.add_metadata("about", {"key": "value", "empty": ""})
        writer.add_attachment(0, 0, "notes.txt", "text/plain", b"some notes")
        channels = {
            topic: writer.register_channel(topic, "json", 0)
            for topic in dict.fromkeys(topic for topic, _, _ in messages)
        }
        for topic, time, content in messages:
            writer.add_message(channels[topic], time, content, time)
        writer.finish()
    return path


def stored(file: McapFile, topic: str) -> list[tuple[int, bytes]]:
    return [
        (time, bytes(file.payload(chunk, offset)))
        for time, chunk, offset in file.entries(topic).tolist()
    ]


def summary_start(content: bytes | bytearray) -> int:
    return int(struct.unpack_from("<Q", content, len(content) - 8 - 20)[0])


def without_summary_checksum(content: bytearray) -> bytearray:
    content[-12:-8] = bytes(4)
    return content


@settings(max_examples=60, deadline=None)
@given(
    messages=st.lists(
        st.tuples(
            st.sampled_from(["/a", "/b", "/c"]), st.integers(0, 2**62), st.binary(max_size=90)
        ),
        max_size=40,
    ),
    compression=st.sampled_from(COMPRESSIONS),
    chunk_size=st.sampled_from([1, 100, 10_000]),
)
def test_every_message_comes_back_in_the_order_it_was_written(
    tmp_path_factory: pytest.TempPathFactory,
    messages: list[tuple[str, int, bytes]],
    compression: CompressionType,
    chunk_size: int,
) -> None:
    path = tmp_path_factory.mktemp("mcap") / "a.mcap"
    file = McapFile(write(path, messages, compression=compression, chunk_size=chunk_size))
    for topic in ("/a", "/b", "/c", "/unknown"):
        wanted = [(time, content) for name, time, content in messages if name == topic]
        assert stored(file, topic) == wanted
    file.close()


def test_the_stock_reader_agrees(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    messages = [
        (str(rng.choice(["/a", "/b"])), int(rng.integers(1000)), rng.bytes(50)) for _ in range(99)
    ]
    path = write(tmp_path / "a.mcap", messages, compression=CompressionType.ZSTD)
    with path.open("rb") as stream:
        theirs = [
            (message.log_time, message.data)
            for _, _, message in make_reader(stream).iter_messages(topics=["/a"])
        ]
    assert sorted(stored(McapFile(path), "/a")) == sorted(theirs)


def test_metadata_and_attachments_are_found_by_name(tmp_path: Path) -> None:
    file = McapFile(write(tmp_path / "a.mcap", [("/a", 0, b"x")]))
    assert file.metadata("about") == {"key": "value", "empty": ""}
    assert file.metadata("nothing") is None
    assert file.attachments == ("notes.txt",)
    assert file.attachment("notes.txt") == b"some notes"
    assert file.attachment("other.txt") is None


def test_an_uncompressed_message_is_a_view_of_the_file(tmp_path: Path) -> None:
    content = bytes(range(100))
    file = McapFile(write(tmp_path / "a.mcap", [("/a", 0, content)]))
    ((_, chunk, offset),) = file.entries("/a").tolist()
    one, other = file.payload(chunk, offset), file.payload(chunk, offset)
    assert one.readonly
    assert np.frombuffer(one, np.uint8).ctypes.data == np.frombuffer(other, np.uint8).ctypes.data


def test_views_outlive_the_file(tmp_path: Path) -> None:
    file = McapFile(write(tmp_path / "a.mcap", [("/a", 0, b"content")]))
    ((_, chunk, offset),) = file.entries("/a").tolist()
    view = np.frombuffer(file.payload(chunk, offset), np.uint8)
    file.close()
    assert view.tobytes() == b"content"


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(MissingPath, match=r"nowhere\.mcap does not exist"):
        McapFile(tmp_path / "nowhere.mcap")


@pytest.mark.parametrize("content", [b"", b"\x89MC", b"RRF2 and so on", b"{}" * 900])
def test_what_is_no_mcap_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(content)
    with pytest.raises(BadEpisode, match="is not an MCAP file"):
        McapFile(path)


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_file_cut_anywhere_says_that_it_is_cut(
    tmp_path: Path, compression: CompressionType
) -> None:
    messages = [("/a", time, bytes(40)) for time in range(9)]
    whole = write(tmp_path / "a.mcap", messages, compression=compression).read_bytes()
    cut = tmp_path / "cut.mcap"
    for length in (*range(8, len(whole), 17), len(whole) - 1):
        cut.write_bytes(whole[:length])
        with pytest.raises(BadEpisode, match=r"cut off in the middle.*`dnet inspect repair"):
            McapFile(cut)


@pytest.mark.parametrize("compression", COMPRESSIONS)
def test_a_flipped_byte_of_a_message_is_noticed(
    tmp_path: Path, compression: CompressionType
) -> None:
    path = write(
        tmp_path / "a.mcap", [("/a", 0, b"precious content")], compression=compression, chunk_size=1
    )
    content = bytearray(path.read_bytes())
    with path.open("rb") as stream:
        (chunk,) = make_reader(stream).get_summary().chunk_indexes  # type: ignore[union-attr]
    content[chunk.chunk_start_offset + chunk.chunk_length - 8] ^= 1
    path.write_bytes(content)
    file = McapFile(path)
    ((_, number, offset),) = file.entries("/a").tolist()
    with pytest.raises(BadEpisode, match="is damaged"):
        file.payload(number, offset)


def test_a_flipped_byte_of_the_summary_or_an_attachment_is_noticed(tmp_path: Path) -> None:
    path = write(tmp_path / "a.mcap", [("/a", 0, b"x")])
    whole = path.read_bytes()
    spoiled = bytearray(whole)
    spoiled[summary_start(whole) + 12] ^= 1
    path.write_bytes(spoiled)
    with pytest.raises(BadEpisode, match="its summary fails its checksum"):
        McapFile(path)
    spoiled = bytearray(whole)
    spoiled[whole.index(b"some notes")] ^= 1
    path.write_bytes(spoiled)
    with pytest.raises(BadEpisode, match=r"its attachment notes\.txt fails its checksum"):
        McapFile(path).attachment("notes.txt")


@pytest.mark.parametrize(
    ("indexes", "chunked"),
    [(IndexType.METADATA, True), (IndexType.CHUNK, True), (IndexType.ALL, False)],
)
def test_a_file_without_message_indexes_is_not_taken_for_an_empty_one(
    tmp_path: Path, indexes: IndexType, chunked: bool
) -> None:
    path = write(tmp_path / "a.mcap", [("/a", 0, b"x")], indexes=indexes, chunked=chunked)
    with pytest.raises(BadEpisode, match="has no message index"):
        McapFile(path)


@settings(max_examples=300, deadline=None)
@given(data=st.data(), compression=st.sampled_from(COMPRESSIONS))
def test_no_spoiled_byte_breaks_more_than_the_episode(
    tmp_path_factory: pytest.TempPathFactory,
    data: st.DataObject,
    compression: CompressionType,
) -> None:
    """Bytes are changed and the checksum that would tell is taken out of the way."""
    path = tmp_path_factory.mktemp("spoiled") / "a.mcap"
    messages = [("/a", time, bytes(30)) for time in range(6)]
    content = bytearray(write(path, messages, compression=compression).read_bytes())
    without_summary_checksum(content)
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(8, len(content) - 9))
        value = data.draw(st.sampled_from([0, 1, 127, 128, 255]))
        content[place] = value
    path.write_bytes(content)
    # Anything but a refusal fails the test.
    with suppress(BadEpisode):
        file = McapFile(path)
        stored(file, "/a")
        for name in file.attachments:
            file.attachment(name)
        file.metadata("about")


@pytest.mark.parametrize("size", [LARGEST_CHUNK + 1, 2**40, 2**63])
def test_a_chunk_that_promises_too_much_is_refused_before_it_is_made(
    tmp_path: Path, size: int
) -> None:
    path = write(
        tmp_path / "a.mcap", [("/a", 0, bytes(500))], compression=CompressionType.ZSTD, chunk_size=1
    )
    content = bytearray(path.read_bytes())
    with path.open("rb") as stream:
        (chunk,) = make_reader(stream).get_summary().chunk_indexes  # type: ignore[union-attr]
    struct.pack_into("<Q", content, chunk.chunk_start_offset + 9 + 16, size)
    path.write_bytes(content)
    file = McapFile(path)
    with pytest.raises(BadEpisode, match=f"{size} bytes when decompressed, at most"):
        file.payload(0, 0)


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4])
def test_a_bomb_is_not_inflated(tmp_path: Path, compression: CompressionType) -> None:
    path = write(
        tmp_path / "a.mcap", [("/a", 0, bytes(40 * 2**20))], compression=compression, chunk_size=1
    )
    content = bytearray(path.read_bytes())
    assert len(content) < 2**20
    with path.open("rb") as stream:
        (chunk,) = make_reader(stream).get_summary().chunk_indexes  # type: ignore[union-attr]
    struct.pack_into("<Q", content, chunk.chunk_start_offset + 9 + 16, 100)
    path.write_bytes(content)
    with pytest.raises(BadEpisode, match="101 bytes where 100 were promised"):
        McapFile(path).payload(0, 0)


def test_chunks_that_share_bytes_are_refused(tmp_path: Path) -> None:
    messages = [("/a", time, bytes(300)) for time in range(4)]
    content = bytearray(write(tmp_path / "a.mcap", messages, chunk_size=1).read_bytes())
    with (tmp_path / "a.mcap").open("rb") as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes  # type: ignore[union-attr]
    first, second = (struct.pack("<Q", chunk.chunk_start_offset) for chunk in chunks[:2])
    place = content.index(second, summary_start(content))
    content[place : place + 8] = first
    (tmp_path / "b.mcap").write_bytes(without_summary_checksum(content))
    with pytest.raises(BadEpisode, match="its chunks overlap"):
        McapFile(tmp_path / "b.mcap")
