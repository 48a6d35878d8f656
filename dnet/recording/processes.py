"""Pairs on several processes of one machine: the same bytes whatever their number."""

import os
import signal
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import connection, get_context, parent_process
from typing import Any

from dnet.errors import WorkerDied
from dnet.laboratory import laboratory
from dnet.recording.pair import PairReport, record_pair
from dnet.recording.request import RecordingRequest
from dnet.recording.store import Store
from dnet.recording.worker import kept_laboratory

POLL = 0.2
"""Seconds between two looks at how far the workers are."""

Progress = Callable[[int], None]
"""Told how many shapes were done since the last time."""


def record_here(
    request: RecordingRequest, indices: Sequence[int], store: Store, progress: Progress
) -> Generator[PairReport, None, None]:
    """Record pairs one after another in this process."""
    with laboratory(request.laboratory) as lab:
        for index in indices:
            yield record_pair(lab, request, index, store, shape_done=lambda: progress(1))


def record_in_processes(
    request: RecordingRequest,
    indices: Sequence[int],
    store: Store,
    progress: Progress,
    *,
    workers: int,
) -> Generator[PairReport, None, None]:
    """Record pairs on `workers` processes, and yield each as it is finished.

    Ctrl-C, or closing the iterator, lets every worker close the file that it writes. Workers
    never outlive this process, even if it is killed.

    Raises:
        WorkerDied: If a worker is killed; what was finished is kept.
        OtherWorker: If the workers do not see what this process sees.
        DnetError: What a worker raises.
    """
    context = get_context("spawn")
    done, stop = context.Value("q", 0), context.Event()
    pool = ProcessPoolExecutor(
        workers, mp_context=context, initializer=_start, initargs=(request, store, done, stop)
    )
    reported = 0
    try:
        with _inherited():
            pending: set[Future[PairReport]] = {pool.submit(_record, index) for index in indices}
        while pending:
            finished, pending = wait(pending, timeout=POLL, return_when=FIRST_COMPLETED)
            count = done.value
            progress(count - reported)
            reported = count
            # Those that failed come last: what was finished along with them is not lost.
            for future in sorted(finished, key=lambda one: one.exception() is not None):
                yield future.result()
    except BrokenProcessPool as error:
        raise WorkerDied(
            f"recorded into {store.name}",
            "finished episodes are kept, the same call goes on; fewer --workers take less memory",
        ) from error
    finally:
        stop.set()
        pool.shutdown(cancel_futures=True)


@contextmanager
def _inherited() -> Iterator[None]:
    """Give the processes that are started here what they need from their first instruction on.

    Ctrl-C reaches the whole process group, but only the parent says what it means. And each has
    one thread: the workers are the parallelism.
    """
    added = {"OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"} - os.environ.keys()
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        os.environ.update(dict.fromkeys(added, "1"))
        yield
    finally:
        for name in added:
            del os.environ[name]
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


class _Stopped(Exception):
    """The parent wants no more."""


class _Worker:
    """What the parent told this process."""

    request: RecordingRequest
    store: Store
    done: Any
    stop: Any


def _start(request: RecordingRequest, store: Store, done: Any, stop: Any) -> None:
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _Worker.request, _Worker.store, _Worker.done, _Worker.stop = request, store, done, stop


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


def _record(index: int) -> PairReport:
    _stop_if_told()
    lab = kept_laboratory(_Worker.request, _Worker.store)
    return record_pair(lab, _Worker.request, index, _Worker.store, shape_done=_shape_done)


def _shape_done() -> None:
    with _Worker.done.get_lock():
        _Worker.done.value += 1
    _stop_if_told()


def _stop_if_told() -> None:
    if _Worker.stop.is_set():
        raise _Stopped
