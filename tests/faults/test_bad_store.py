"""An object store that answers slowly, wrongly or not at all: asked again, a bounded time."""

import os
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("s3fs", reason="not installed: object stores are not tested here")

import fsspec.config
from s3fs import S3FileSystem

from dnet.datasets.index import open_index
from dnet.errors import StoreFailed, Unfetched
from dnet.recording.remote_store import RemoteStore
from tests.faults.bad_store import BadStore, Fault, bad_store
from tests.recorders import rollout
from tests.recording import cloud

FAULTS: tuple[Fault, ...] = ("slow", "truncated", "reset", "error", "garbage")
IMPATIENT = {"read_timeout": 1, "connect_timeout": 1, "retries": {"max_attempts": 2}}


@pytest.fixture(scope="module")
def bucket() -> Iterator[str]:
    with cloud.object_store() as url:
        yield url


@pytest.fixture
def store(bucket: str, monkeypatch: pytest.MonkeyPatch) -> Iterator[BadStore]:
    """What stands before the bucket; connections live for one request each."""
    host, port = os.environ["AWS_ENDPOINT_URL"].removeprefix("http://").split(":")
    with bad_store((host, int(port))) as (store, before):
        monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{before}")
        monkeypatch.setitem(fsspec.config.conf, "s3", {"config_kwargs": IMPATIENT})
        S3FileSystem.clear_instance_cache()
        yield store
    S3FileSystem.clear_instance_cache()


def dataset(url: str, folder: Path) -> str:
    """Put an episode into the store; return where."""
    path = rollout.write(folder / "episode-0.mcap", rollout.frames(3))
    RemoteStore(url).write(path.name, path.read_bytes())
    return url


@pytest.mark.parametrize("fault", FAULTS)
def test_reading_outlasts_a_fault_that_passes(
    store: BadStore, bucket: str, tmp_path: Path, fault: Fault
) -> None:
    url = dataset(f"{bucket}/read-{fault}", tmp_path)
    S3FileSystem.clear_instance_cache()
    store.fault, store.times = fault, 2
    assert open_index(url).frames.height == 5
    assert store.times <= 0


@pytest.mark.parametrize("fault", FAULTS)
def test_writing_outlasts_a_fault_that_passes(
    store: BadStore, bucket: str, tmp_path: Path, fault: Fault
) -> None:
    url = f"{bucket}/write-{fault}"
    store.fault, store.times = fault, 2
    path = rollout.write(tmp_path / "episode-0.mcap", rollout.frames(3))
    content = path.read_bytes()
    RemoteStore(url, pauses=(0.1,)).keep(path)
    assert RemoteStore(url).read("episode-0.mcap") == content


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["reset", "error", "garbage", "silent"])
def test_a_store_that_stays_bad_is_given_up_by_name_and_the_episode_stays(
    store: BadStore, bucket: str, tmp_path: Path, fault: Fault
) -> None:
    path = rollout.write(tmp_path / "episode-0.mcap", rollout.frames(3))
    store.fault, store.times = fault, 10**6
    url = f"{bucket}/gone-{fault}"
    clock = time.monotonic()
    with pytest.raises(StoreFailed, match=f"{url} fails: .*finished episodes are kept"):
        RemoteStore(url, pauses=(0.1,), patience=5.0).keep(path)
    with pytest.raises(Unfetched, match=f"{url} cannot be read: "):
        open_index(url)
    assert path.exists()
    assert store.seen <= 60
    assert time.monotonic() - clock < 120
    print(f"{fault}: {store.seen} connections, {time.monotonic() - clock:.1f} s")
