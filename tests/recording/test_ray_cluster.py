"""A Ray cluster records what this machine would, byte for byte, and survives a lost node."""

import time
from collections.abc import Iterator
from contextlib import closing
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from dnet.errors import ClusterFailed, NoCluster, OtherWorker
from dnet.recording.dataset import record_missing, recording
from dnet.recording.folder_store import FolderStore
from dnet.recording.ray_cluster import record_on_ray
from dnet.recording.request import RecordingRequest
from dnet.recording.store import Store, open_store
from tests.recording import cloud
from tests.recording.synthetic import REQUEST, contents, request


@pytest.fixture(scope="module")
def bucket() -> Iterator[str]:
    with cloud.object_store() as url:
        yield url


@pytest.fixture(scope="module")
def cluster(bucket: str, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """Begun after the bucket, whose address its workers inherit."""
    with cloud.two_nodes(tmp_path_factory.mktemp("scratch")) as cluster:
        yield cluster


def ignore(shapes: int) -> None:
    """Progress is not what is tested."""


def on_this_machine(folder: Path, asked: RecordingRequest) -> dict[str, bytes]:
    with recording(FolderStore(folder), asked) as manifest:
        record_missing(manifest, progress=ignore)
    return contents(folder)


def held(store: Store) -> dict[str, bytes]:
    return {name: store.read(name) for name in store.sizes() if name != "timings.jsonl"}


def test_two_nodes_write_the_bytes_of_one_machine_to_an_object_store(
    cluster: Any, bucket: str, tmp_path: Path
) -> None:
    store, told = open_store(f"{bucket}/data", shared=True), list[int]()
    with recording(store, REQUEST) as manifest:
        record_missing(manifest, ray=cluster.address, progress=told.append)
    assert sum(told) == 3
    assert held(store) == on_this_machine(tmp_path, REQUEST)
    assert len(store.read("timings.jsonl").splitlines()) == 3


def test_a_shared_folder_holds_the_same_and_nothing_else(cluster: Any, tmp_path: Path) -> None:
    out = tmp_path / "shared"
    with recording(open_store(out, shared=True), REQUEST) as manifest:
        record_missing(manifest, ray=cluster.address, progress=ignore)
    expected = on_this_machine(tmp_path / "here", REQUEST)
    assert contents(out) == expected
    left = {path.name for path in out.iterdir()}
    assert left == {*expected, "timings.jsonl", ".recording.lock"}


def test_workers_that_see_another_store_refuse_it(cluster: Any) -> None:
    with (
        recording(open_store("memory://not-shared"), REQUEST) as manifest,
        pytest.raises(OtherWorker, match=r"memory://not-shared: it cannot read manifest\.json"),
    ):
        record_missing(manifest, ray=cluster.address, progress=ignore)


class Elsewhere(FolderStore):
    """A store of a package that only this machine has."""

    def __reduce__(self) -> tuple[Any, ...]:
        return import_module, ("a_package_of_ours",)


def test_what_a_node_lacks_is_named(cluster: Any, tmp_path: Path) -> None:
    with (
        recording(Elsewhere(tmp_path), REQUEST) as manifest,
        pytest.raises(ClusterFailed, match="No module named 'a_package_of_ours'"),
    ):
        record_missing(manifest, ray=cluster.address, progress=ignore)


def test_a_node_lost_on_the_way_costs_nothing_but_time(
    cluster: Any, bucket: str, tmp_path: Path
) -> None:
    asked, store = request(4, shapes=6), open_store(f"{bucket}/lost", shared=True)
    with recording(store, asked) as manifest:
        reports = record_on_ray(asked, manifest.missing(), store, ignore, address=cluster.address)
        with closing(reports):
            manifest.add(next(reports))
            deadline = time.monotonic() + 60
            while cloud.ray.available_resources().get("CPU", 0):
                assert time.monotonic() < deadline, "both nodes should be at work"
            (node,) = cluster.worker_nodes
            cluster.remove_node(node, allow_graceful=False)
            for report in reports:
                manifest.add(report)
    assert held(store) == on_this_machine(tmp_path, asked)


@pytest.mark.parametrize(
    ("address", "why"),
    [("127.0.0.1:1", "Connection refused"), ("nonsense", "Invalid address format")],
)
def test_an_address_without_a_cluster_is_refused(tmp_path: Path, address: str, why: str) -> None:
    with (
        recording(FolderStore(tmp_path), REQUEST) as manifest,
        pytest.raises(NoCluster, match=f"no Ray cluster at {address}: .*{why}"),
    ):
        record_missing(manifest, ray=address, progress=ignore)
