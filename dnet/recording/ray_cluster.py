"""Pairs on a Ray cluster: a task each, the same bytes wherever it runs."""

import os
import socket
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from dnet.errors import ClusterFailed, DnetError, MissingExtra, NoCluster, WorkerDied
from dnet.recording.pair import PairReport, record_pair
from dnet.recording.request import RecordingRequest
from dnet.recording.store import Store
from dnet.recording.worker import kept_laboratory

AHEAD = 2
"""Tasks handed out for each processor of the cluster: it never waits, and forgets little."""
RETRIES = 5
"""How often a pair is begun anew because its node was lost."""
POLL = 1.0
"""Seconds between two looks at how large the cluster is."""
PATIENCE = 5.0
"""Seconds for a cluster to answer, and for its workers to leave their files."""
OBJECTS = 100_000_000
"""Bytes of shared memory for a cluster of our own: only reports go through it."""


def record_on_ray(
    request: RecordingRequest,
    indices: Sequence[int],
    store: Store,
    progress: Callable[[int], None],
    *,
    address: str,
) -> Generator[PairReport, None, None]:
    """Record pairs on a Ray cluster, one at a time on each processor, and yield each when done.

    Every node needs dnet in the same versions, and must see the store; each worker checks both
    before it records. A pair whose node is lost is recorded again on another. Bytes are the same
    on processors of one kind: compiled sums are rounded as the processor likes.

    Args:
        request: What to record.
        indices: Which pairs of it.
        store: Where they go.
        progress: Told of all shapes of a pair when it is finished.
        address: `HOST:PORT` of a cluster; `auto` for that of this machine; `local` for one that
            lasts as long as this recording.

    Raises:
        MissingExtra: If Ray is not installed.
        NoCluster: If there is no cluster at the address, or it has no processors.
        WorkerDied: If a pair loses one node after the other.
        OtherWorker: If a node has other versions, or does not see the store.
        ClusterFailed: If a node has no dnet.
        DnetError: What a worker raises.
    """
    ray = _ray()
    with _connected(ray, address):
        record = ray.remote(num_cpus=1, max_retries=RETRIES)(_record)
        left, pending = deque(indices), set[Any]()
        try:
            while left or pending:
                # Without a processor Ray waits for one: nodes come and go.
                room = max(1, AHEAD * int(ray.cluster_resources().get("CPU", 0)))
                while left and len(pending) < room:
                    pending.add(record.remote(request, left.popleft(), store))
                finished, _ = ray.wait(list(pending), timeout=POLL)
                for one in finished:
                    pending.remove(one)
                    report = _report(ray, one, store, address)
                    progress(request.shapes)
                    yield report
        finally:
            for one in pending:
                ray.cancel(one)
            if pending:
                ray.wait(list(pending), num_returns=len(pending), timeout=PATIENCE)


def _record(request: RecordingRequest, index: int, store: Store) -> PairReport:
    lab = kept_laboratory(request, store)
    return record_pair(lab, request, index, store, shape_done=lambda: None)


def _report(ray: Any, task: Any, store: Store, address: str) -> PairReport:
    """Return what a finished task returned, or raise what it raised."""
    try:
        report: PairReport = ray.get(task)
    except ray.exceptions.RayTaskError as error:
        if isinstance(error.cause, (DnetError, OSError)):
            raise error.cause from error
        if isinstance(error.cause, ray.exceptions.RayError):
            # The task did not even begin: its node lacks what it takes.
            raise ClusterFailed(address, str(error).strip().splitlines()[-1]) from error
        raise
    except ray.exceptions.RayError as error:
        # Whatever became of the node, or the next: Ray has tried several.
        raise WorkerDied(
            f"recorded into {store.name}", "finished episodes are kept, the same call goes on"
        ) from error
    return report


def _ray() -> Any:
    # Ray counts its users unless it is told not to.
    os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
    try:
        import ray  # noqa: PLC0415  # an extra
    except ImportError as error:
        raise MissingExtra("ray", "ray", "recording on a cluster") from error
    return ray


@contextmanager
def _connected(ray: Any, address: str) -> Iterator[None]:
    if address == "local":
        new: dict[str, Any] = {"include_dashboard": False, "object_store_memory": OBJECTS}
    else:
        new = {}
        _check_answers(address)
    try:
        ray.init(address=address, log_to_driver=False, logging_level="ERROR", **new)
    except (ConnectionError, ValueError, RuntimeError) as error:
        raise NoCluster(address, str(error).strip().split("\n")[0]) from error
    try:
        if not ray.cluster_resources().get("CPU", 0):
            raise NoCluster(address, "it has no processors")
        yield
    finally:
        ray.shutdown()


def _check_answers(address: str) -> None:
    """Refuse an address at which nobody listens: Ray itself would wait there for minutes."""
    host, _, port = address.rpartition(":")
    if host and port.isdecimal():
        try:
            socket.create_connection((host, int(port)), timeout=PATIENCE).close()
        except OSError as error:
            raise NoCluster(address, str(error)) from error
