from pathlib import Path
from typing import Any

import fsspec
import numpy as np
import pytest

from dnet.datasets.reader import EpisodeReader
from dnet.datasets.sources import BLOCK, BlockCache, RemoteFile, fetch, version_of
from dnet.errors import MissingPath, Unfetched, UnknownStore
from tests.datasets.dataset import upload, write_dataset

CONTENT = np.random.default_rng(0).bytes(3 * BLOCK + 1000)


class Short:
    """A store that returns less than it is asked for."""

    def cat_file(self, _path: str, *, start: int, end: int) -> bytes:
        return b"x" * (end - start - 1)


class Counting:
    """A store that counts the requests."""

    def __init__(self, files: Any) -> None:
        self.files, self.requests = files, 0

    def cat_file(self, path: str, *, start: int, end: int) -> bytes:
        self.requests += 1
        content: bytes = self.files.cat_file(path, start=start, end=end)
        return content


@pytest.fixture
def url() -> str:
    fsspec.filesystem("memory").pipe_file("/sources/file.bin", CONTENT)
    return "memory://sources/file.bin"


@pytest.mark.parametrize(
    ("start", "stop"),
    [(0, 8), (BLOCK - 4, BLOCK + 4), (0, len(CONTENT)), (BLOCK, 2 * BLOCK), (7, 7), (5, 3 * BLOCK)],
)
def test_a_remote_file_is_read_by_ranges(url: str, start: int, stop: int) -> None:
    file = RemoteFile(url, cache=BlockCache())
    assert len(file) == len(CONTENT)
    assert file.view(start, stop) == CONTENT[start:stop]


def test_a_block_is_fetched_once_while_it_is_kept(url: str) -> None:
    cache = BlockCache(capacity=2 * BLOCK)
    file = RemoteFile(url, cache=cache)
    counting = Counting(fsspec.filesystem("memory"))
    file._files = counting
    for _ in range(3):
        file.view(10, 20)
        file.view(BLOCK + 10, BLOCK + 20)
    assert counting.requests == 2
    file.view(2 * BLOCK, 2 * BLOCK + 1)
    assert cache.bytes <= 2 * BLOCK
    # The first block was read least recently: it made room.
    file.view(BLOCK, BLOCK + 1)
    assert counting.requests == 3
    file.view(0, 1)
    assert counting.requests == 4


def test_another_file_of_the_same_name_is_not_read_from_old_blocks(url: str) -> None:
    cache = BlockCache()
    assert RemoteFile(url, cache=cache).view(0, 4) == CONTENT[:4]
    fsspec.filesystem("memory").pipe_file("/sources/file.bin", b"other content")
    assert bytes(RemoteFile(url, cache=cache).view(0, 5)) == b"other"


def test_an_episode_behind_a_url_is_read_like_a_file(tmp_path: Path) -> None:
    folder = write_dataset(tmp_path / "data", (3,))
    url = upload(folder, "episodes")
    with (
        EpisodeReader(folder / "episode-0.mcap") as near,
        EpisodeReader(f"{url}/episode-0.mcap") as far,
    ):
        assert far.kinds == near.kinds
        assert far.meta == near.meta
        assert far.attachments == near.attachments
        for index in range(len(near)):
            np.testing.assert_array_equal(far.cloud(index), near.cloud(index))
            np.testing.assert_array_equal(far.grasps[index], near.grasps[index])


def test_what_a_store_does_not_have_or_give_is_said(url: str) -> None:
    with pytest.raises(MissingPath, match=r"memory://sources/none\.mcap does not exist"):
        EpisodeReader("memory://sources/none.mcap")
    with pytest.raises(UnknownStore, match="nowhere"):
        EpisodeReader("nowhere://sources/none.mcap")
    with pytest.raises(Unfetched, match="9 bytes came where 10 were asked for"):
        fetch(Short(), "path", name=url, start=0, stop=10)


def test_a_version_changes_with_the_size_and_the_stamp() -> None:
    assert version_of({"size": 3, "ETag": "a"}) != version_of({"size": 3, "ETag": "b"})
    assert version_of({"size": 3, "mtime": 1.0}) != version_of({"size": 4, "mtime": 1.0})
