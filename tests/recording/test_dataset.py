"""A recording is begun, gone on with and refused as a whole, and leaves nothing half done."""

import errno
import json
import os
import shutil
import signal
from dataclasses import dataclass, replace
from pathlib import Path

import psutil
import pytest

from dnet.errors import NoSpace, OtherWorker, OutputInUse
from dnet.laboratory import LaboratorySettings
from dnet.recording.dataset import record_missing, recording
from dnet.recording.folder_store import FolderStore
from dnet.recording.manifest import MANIFEST, TIMINGS, open_manifest
from dnet.recording.pair import record_pair
from dnet.recording.request import RecordingRequest
from dnet.recording.store import Store, open_store
from dnet.recording.worker import kept_laboratory
from tests.recording.synthetic import REQUEST, contents, request


def record(store: Store, asked: RecordingRequest, *, workers: int = 1) -> tuple[int, int]:
    """Return how many pairs were recorded, and how many shapes the progress bar was told of."""
    told: list[int] = []
    with recording(store, asked) as manifest:
        return record_missing(manifest, workers=workers, progress=told.append), sum(told)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The request recorded in one go, in this process."""
    folder = tmp_path_factory.mktemp("undisturbed")
    assert record(FolderStore(folder), REQUEST) == (3, 3)
    return folder


def test_two_workers_write_the_bytes_of_one_and_leave_nothing_behind(
    undisturbed: Path, tmp_path: Path
) -> None:
    before = dict(os.environ), signal.pthread_sigmask(signal.SIG_BLOCK, [])
    assert record(FolderStore(tmp_path), REQUEST, workers=2) == (3, 3)
    assert contents(tmp_path) == contents(undisturbed)
    assert (dict(os.environ), signal.pthread_sigmask(signal.SIG_BLOCK, [])) == before
    timings = map(json.loads, (tmp_path / TIMINGS).read_text().splitlines())
    workers = {timing["worker"] for timing in timings}
    assert os.getpid() not in workers
    assert not any(map(psutil.pid_exists, workers))


def test_what_was_removed_comes_back_with_the_same_bytes(undisturbed: Path, tmp_path: Path) -> None:
    shutil.copytree(undisturbed, tmp_path, dirs_exist_ok=True)
    (tmp_path / "episode-5-00001.mcap").unlink()
    assert record(FolderStore(tmp_path), REQUEST) == (1, 1)
    assert contents(tmp_path) == contents(undisturbed)


def test_growing_step_by_step_writes_the_bytes_of_one_go(undisturbed: Path, tmp_path: Path) -> None:
    for pairs in (1, 3):
        record(FolderStore(tmp_path), request(pairs))
    assert contents(tmp_path) == contents(undisturbed)


def test_a_complete_recording_is_left_as_it_is(undisturbed: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in undisturbed.glob("*.mcap")}
    assert record(FolderStore(undisturbed), REQUEST) == (0, 0)
    assert {path: path.stat().st_mtime_ns for path in undisturbed.glob("*.mcap")} == before


def test_an_object_store_gets_the_same_bytes(undisturbed: Path) -> None:
    store = open_store("memory://same-bytes")
    assert record(store, REQUEST) == (3, 3)
    assert {name: store.read(name) for name in contents(undisturbed)} == contents(undisturbed)


def test_a_worker_that_sees_another_store_refuses_to_record() -> None:
    """Each process has a memory of its own: what is recorded there would be lost."""
    with pytest.raises(OtherWorker, match=r"memory://not-shared: it cannot read manifest\.json"):
        kept_laboratory(REQUEST, open_store("memory://not-shared"))


def test_a_worker_with_another_version_refuses_to_record(tmp_path: Path) -> None:
    store = FolderStore(tmp_path)
    with recording(store, REQUEST):
        pass
    text = (tmp_path / MANIFEST).read_text()
    version = f'"numpy": "{REQUEST.settings["laboratory"]["versions"]["numpy"]}"'
    assert version in text
    (tmp_path / MANIFEST).write_text(text.replace(version, '"numpy": "1.0"'))
    with pytest.raises(OtherWorker, match=r"laboratory\.versions\.numpy 1\.0 there"):
        kept_laboratory(REQUEST, store)


def test_a_second_recording_in_the_same_folder_is_refused(tmp_path: Path) -> None:
    with recording(FolderStore(tmp_path), REQUEST):
        before = contents(tmp_path)
        with pytest.raises(OutputInUse), recording(FolderStore(tmp_path), REQUEST):
            pass
    assert contents(tmp_path) == before


def test_too_much_for_the_disk_is_refused_and_less_may_be_asked_for_at_once(tmp_path: Path) -> None:
    much = request(3, shapes=10**10)
    with pytest.raises(NoSpace, match=r"the recording takes about \d{6,}\.\d\d GB"):
        record(FolderStore(tmp_path), much)
    with recording(FolderStore(tmp_path), REQUEST) as manifest:
        assert manifest.missing() == [0, 1, 2]


@dataclass(frozen=True)
class Small(FolderStore):
    """A disk with room for a few episodes only."""

    room: int = 2

    def check_room(self, episodes: int, *, episode_bytes: int) -> None:
        free = self.room - len(list(self.folder.glob("*.mcap")))
        if free < min(episodes, 1):
            raise NoSpace(self.folder, episodes * episode_bytes, free * episode_bytes)

    def keep(self, path: Path) -> None:
        if len(list(self.folder.glob("*.mcap"))) > self.room:
            path.unlink()
            raise OSError(errno.ENOSPC, "No space left on device")
        super().keep(path)


def test_a_disk_that_fills_up_is_said_to_be_full_and_what_was_finished_stays(
    undisturbed: Path, tmp_path: Path
) -> None:
    with pytest.raises(NoSpace, match=r"has 0\.00 MB free"):
        record(Small(tmp_path), REQUEST)
    assert open_manifest(FolderStore(tmp_path), REQUEST).missing() == [2]
    record(FolderStore(tmp_path), REQUEST)
    assert contents(tmp_path) == contents(undisturbed)


@pytest.mark.parametrize(
    "asked",
    [
        replace(REQUEST, laboratory=LaboratorySettings(world="quasistatic")),
        replace(REQUEST, shapes=2, rate=10.0, images=True),
    ],
)
def test_an_episode_takes_no_more_than_was_reckoned_with_and_not_much_less(
    asked: RecordingRequest, tmp_path: Path
) -> None:
    store = FolderStore(tmp_path)
    with recording(store, asked):
        lab = kept_laboratory(asked, store)
        report = record_pair(lab, asked, 0, store, shape_done=lambda: None)
    assert asked.episode_bytes() / 3 < report.entry["bytes"] < asked.episode_bytes()
