"""A folder and an object store keep the same promises to a recording."""

import pickle
from collections.abc import Iterator
from pathlib import Path
from typing import Any, ClassVar

import fsspec
import pytest
from fsspec.implementations.memory import MemoryFileSystem

from dnet.errors import (
    NoSpace,
    OccupiedOutput,
    OtherRequest,
    OutputInUse,
    StoreFailed,
    UnknownStore,
)
from dnet.recording.folder_store import FolderStore
from dnet.recording.manifest import MANIFEST, open_manifest
from dnet.recording.remote_store import RemoteStore
from dnet.recording.store import Store, open_store
from tests.recording.synthetic import REQUEST, report, request, write_episode


class Flaky(MemoryFileSystem):  # type: ignore[misc]  # fsspec has no types
    """A store in memory that fails at first, or loses what it takes."""

    protocol: ClassVar[str] = "flaky"
    store: ClassVar[dict[str, Any]] = {}
    pseudo_dirs: ClassVar[list[str]] = [""]
    failures: ClassVar[list[Exception]] = []
    """What the next attempts to write raise."""
    losing: ClassVar[bool] = False

    def put_file(self, lpath: str, rpath: str, **options: Any) -> None:
        if self.failures:
            raise self.failures.pop(0)
        content = Path(lpath).read_bytes()
        super().pipe_file(rpath, content[:-1] if self.losing else content)


fsspec.register_implementation("flaky", Flaky, clobber=True)


@pytest.fixture(autouse=True)
def empty() -> Iterator[None]:
    yield
    for kind in (MemoryFileSystem, Flaky):
        kind.store.clear()
        kind.pseudo_dirs[:] = [""]
    Flaky.failures, Flaky.losing = [], False


@pytest.fixture(params=["folder", "shared folder", "memory"])
def store(request: pytest.FixtureRequest, tmp_path: Path) -> Store:
    if request.param == "memory":
        return open_store("memory://bucket/data")
    return open_store(tmp_path / "data", shared=request.param == "shared folder")


def keep(store: Store, *indices: int) -> None:
    """Record those pairs of the request, and enter them."""
    with store.alone():
        manifest = open_manifest(store, REQUEST)
        manifest.write()
        for index in indices:
            with store.scratch(0) as scratch:
                path = write_episode(scratch, REQUEST, index)
                done = report(path, REQUEST)
                store.keep(path)
            manifest.add(done)


def test_a_store_holds_what_was_written_last(store: Store) -> None:
    with store.alone():
        assert "a" not in store.sizes()
        store.write("a", b"12")
        store.write("a", b"345")
        assert store.sizes()["a"] == 3
        assert store.read("a") == b"345"


def test_lines_are_added_to_what_is_there(store: Store) -> None:
    with store.alone():
        store.append("log", "one")
        store.append("log", "two")
        assert store.read("log") == b"one\ntwo\n"


def test_what_is_not_there_cannot_be_read(store: Store) -> None:
    with store.alone(), pytest.raises(StoreFailed, match="gone"):
        store.read("gone")


def test_a_store_that_is_not_there_yet_is_empty(store: Store) -> None:
    assert store.sizes() == {}


def test_a_store_can_be_sent_to_another_process(store: Store) -> None:
    assert pickle.loads(pickle.dumps(store)) == store  # noqa: S301


def test_a_recording_goes_on_wherever_it_is(store: Store, tmp_path: Path) -> None:
    keep(store, 1)
    assert open_manifest(store, REQUEST).missing() == [0, 2]
    keep(store, 0, 2)
    assert open_manifest(store, REQUEST).missing() == []
    here = FolderStore(tmp_path / "here")
    keep(here, 0, 1, 2)
    for name in (MANIFEST, *(f"{REQUEST.episode_id(index)}.mcap" for index in range(3))):
        assert store.read(name) == here.read(name)
    with pytest.raises(OtherRequest, match="shapes 1 there, 2 now"):
        open_manifest(store, request(3, shapes=2))


def test_nothing_but_what_was_kept_is_left(store: Store, tmp_path: Path) -> None:
    keep(store, 0)
    expected = {"episode-5-00000.mcap", MANIFEST, "timings.jsonl"}
    assert store.sizes().keys() - {".recording.lock"} == expected
    if store.folder is not None:
        assert {path.name for path in store.folder.iterdir()} == {*expected, ".recording.lock"}


def test_an_upload_that_the_manifest_lacks_is_recorded_again() -> None:
    store = RemoteStore("memory://bucket/data")
    keep(store, 0, 1, 2)
    whole = store.read("episode-5-00001.mcap")
    manifest = open_manifest(store, REQUEST)
    del manifest.episodes["episode-5-00001"]
    manifest.write()
    assert open_manifest(store, REQUEST).missing() == [1]
    keep(store, 1)
    assert store.read("episode-5-00001.mcap") == whole


def test_a_locked_folder_admits_no_second_recording(tmp_path: Path) -> None:
    one, other = FolderStore(tmp_path), FolderStore(tmp_path)
    with one.alone(), pytest.raises(OutputInUse), other.alone():
        pass
    with FolderStore(tmp_path).alone():
        pass


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    file = tmp_path / "data"
    file.write_text("mine")
    with pytest.raises(OccupiedOutput), FolderStore(file).alone():
        pass
    with pytest.raises(StoreFailed), FolderStore(file / "below").alone():
        pass
    assert file.read_text() == "mine"


def test_what_a_lost_worker_left_in_a_shared_folder_is_removed(tmp_path: Path) -> None:
    store = FolderStore(tmp_path, in_place=False)
    with store.alone(), store.scratch(0) as lost:
        write_episode(lost, REQUEST, 0)
        kept = lost.rename(f"{lost}-left")
        lost.mkdir()
    assert kept.exists()
    with store.alone():
        assert not kept.exists()


def test_a_disk_without_room_is_refused_with_the_figures(tmp_path: Path) -> None:
    folder = FolderStore(tmp_path)
    with pytest.raises(NoSpace, match=r"GB free, the recording takes about 5000000\.00 GB"):
        folder.check_room(5, episode_bytes=10**15)
    remote = RemoteStore("memory://bucket/data")
    with pytest.raises(NoSpace, match=r"scratch folder .* takes about 1000000\.00 GB"):
        remote.check_room(5, episode_bytes=10**15)
    with pytest.raises(NoSpace), remote.scratch(10**15):
        pass
    folder.check_room(0, episode_bytes=10**15)
    remote.check_room(0, episode_bytes=10**15)


def flaky() -> RemoteStore:
    return RemoteStore("flaky://bucket/data", pauses=(0.0, 0.0))


def test_an_upload_that_fails_for_a_while_is_repeated(tmp_path: Path) -> None:
    store, path = flaky(), write_episode(tmp_path, REQUEST, 0)
    content = path.read_bytes()
    Flaky.failures = [OSError("reset"), RuntimeError("of a client's own kind")]
    store.keep(path)
    assert store.read(path.name) == content
    assert not path.exists()


def test_an_upload_that_always_fails_is_given_up_and_the_file_stays(tmp_path: Path) -> None:
    path = write_episode(tmp_path, REQUEST, 0)
    Flaky.failures = [OSError("reset")] * 9
    with pytest.raises(StoreFailed, match="flaky://bucket/data fails: reset"):
        flaky().keep(path)
    assert len(Flaky.failures) == 9 - 3
    assert path.exists()


def test_what_will_not_pass_is_not_repeated(tmp_path: Path) -> None:
    path = write_episode(tmp_path, REQUEST, 0)
    Flaky.failures = [PermissionError("not yours")] * 9
    with pytest.raises(StoreFailed, match="not yours"):
        flaky().keep(path)
    assert len(Flaky.failures) == 9 - 1


def test_an_upload_of_which_a_part_is_lost_is_noticed(tmp_path: Path) -> None:
    path = write_episode(tmp_path, REQUEST, 0)
    size = path.stat().st_size
    Flaky.losing = True
    with pytest.raises(StoreFailed, match=rf"{size - 1} of {size} bytes of {path.name} arrived"):
        flaky().keep(path)
    assert path.exists()


@pytest.mark.parametrize(
    ("url", "why"),
    [
        ("nowhere://bucket/data", "Protocol not known: nowhere"),
        ("memory://", "names no folder or bucket"),
    ],
)
def test_a_url_that_is_no_store_is_refused(url: str, why: str) -> None:
    with pytest.raises(UnknownStore, match=why):
        open_store(url)


def test_a_file_url_is_a_folder(tmp_path: Path) -> None:
    assert open_store(f"file://{tmp_path}/data") == FolderStore(tmp_path / "data")
    assert open_store(f"{tmp_path}/data") == FolderStore(tmp_path / "data")
