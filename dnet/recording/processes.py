"""Pairs on several processes of one machine: the same bytes whatever their number."""

import os
import signal
import threading
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack
from multiprocessing import connection, get_context, parent_process
from pathlib import Path
from typing import Any

from dnet.errors import WorkerDied
from dnet.laboratory import Laboratory, laboratory
from dnet.recording.pair import PairReport, record_pair
from dnet.recording.request import RecordingRequest

POLL = 0.2
"""Seconds between two looks at how far the workers are."""

Progress = Callable[[int], None]
"""Told how many shapes were done since the last time."""


def record_here(
    request: RecordingRequest, indices: Sequence[int], folder: Path, progress: Progress
) -> Generator[PairReport]:
    """Record pairs one after another in this process."""
    with laboratory(request.laboratory) as lab:
        for index in indices:
            yield record_pair(lab, request, index, folder, shape_done=lambda: progress(1))


def record_in_processes(
    request: RecordingRequest,
    indices: Sequence[int],
    folder: Path,
    progress: Progress,
    *,
    workers: int,
) -> Generator[PairReport]:
    """Record pairs on `workers` processes, and yield each as it is finished.

    Ctrl-C, or closing the iterator, lets every worker close the file that it writes. Workers
    never outlive this process, even if it is killed.

    Raises:
        WorkerDied: If a worker is killed; what was finished is kept.
        DnetError: What a worker raises.
    """
    context = get_context("spawn")
    done, stop = context.Value("q", 0), context.Event()
    # One thread each: the workers are the parallelism.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    pool = ProcessPoolExecutor(
        workers, mp_context=context, initializer=_start, initargs=(request, folder, done, stop)
    )
    reported = 0
    try:
        pending: set[Future[PairReport]] = {pool.submit(_record, index) for index in indices}
        while pending:
            finished, pending = wait(pending, timeout=POLL, return_when=FIRST_COMPLETED)
            count = done.value
            progress(count - reported)
            reported = count
            for future in finished:
                yield future.result()
    except BrokenProcessPool as error:
        raise WorkerDied(folder) from error
    finally:
        stop.set()
        pool.shutdown(cancel_futures=True)


class _Stopped(Exception):
    """The parent wants no more."""


class _Worker:
    """What a worker process keeps from one pair to the next."""

    life = ExitStack()
    """Holds the laboratory for as long as the process lives."""
    lab: Laboratory
    request: RecordingRequest
    folder: Path
    done: Any
    stop: Any


def _start(request: RecordingRequest, folder: Path, done: Any, stop: Any) -> None:
    # Ctrl-C reaches the whole process group; the parent says what it means.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _Worker.request, _Worker.folder, _Worker.done, _Worker.stop = request, folder, done, stop
    _Worker.lab = _Worker.life.enter_context(laboratory(request.laboratory))


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


def _record(index: int) -> PairReport:
    return record_pair(_Worker.lab, _Worker.request, index, _Worker.folder, shape_done=_shape_done)


def _shape_done() -> None:
    with _Worker.done.get_lock():
        _Worker.done.value += 1
    if _Worker.stop.is_set():
        raise _Stopped
