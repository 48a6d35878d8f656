"""Many trials on several processes, each finished one kept: called again, the rest is done."""

import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from multiprocessing import connection, get_context, parent_process
from pathlib import Path
from typing import Any

from dnet.errors import DnetError, MissingPath, NoGoals, WorkerDied
from dnet.files.one_writer import one_writer
from dnet.laboratory import Laboratory, LaboratorySettings, laboratory
from dnet.perception.cloud_file import READERS
from dnet.trials.request import Trial
from dnet.trials.trial import clear, is_finished, refuse, run_trial

POLL = 0.2
"""Seconds between two looks at how far the processes are."""


@dataclass(frozen=True, slots=True)
class Report:
    """What became of one trial, for people; its files tell the rest."""

    trial: Trial
    outcome: str
    """Of the run, or `refused`."""
    line: str
    """Why, or how near it came."""


def goals_in(folder: Path) -> list[tuple[str, str]]:
    """Return the goals of a directory, by name: its episodes and its clouds.

    Raises:
        MissingPath: If there is no such directory.
        NoGoals: If it holds none.
    """
    if not folder.is_dir():
        raise MissingPath(folder, "directory of goals", "give one with episodes or clouds")
    suffixes = (".mcap", *READERS)
    found = sorted(path for path in folder.iterdir() if path.suffix.lower() in suffixes)
    if not found:
        raise NoGoals(folder)
    # Two goals may differ in their suffix alone.
    stems = [path.stem for path in found]
    return [(path.stem if stems.count(path.stem) == 1 else path.name, str(path)) for path in found]


def missing(trials: Sequence[Trial]) -> list[Trial]:
    """Return the trials that are not finished.

    Raises:
        OtherRun: If a directory holds a run with other settings.
    """
    return [trial for trial in trials if not is_finished(trial)]


def run_trials(trials: Sequence[Trial], *, jobs: int, stop: Callable[[], bool]) -> Iterator[Report]:
    """Carry trials out, and yield a report of each as it ends.

    The runs are the same whatever the number of processes.

    Args:
        trials: What is asked; what an unfinished run left in a directory is removed first.
        jobs: How many processes; 1 for this one.
        stop: Whether somebody wants an end: runs under way end as `interrupted`.

    Raises:
        WorkerDied: If a process is killed; what was finished is kept.
        OutputInUse: If another process carries one of them out.
    """
    if jobs == 1:
        with ExitStack() as life:
            kept = _Laboratories(life)
            for trial in trials:
                if stop():
                    return
                yield _carry_out(trial, kept, stop)
        return
    yield from _in_processes(trials, jobs, stop)


def _in_processes(trials: Sequence[Trial], jobs: int, stop: Callable[[], bool]) -> Iterator[Report]:
    context = get_context("spawn")
    told = context.Event()
    pool = ProcessPoolExecutor(jobs, mp_context=context, initializer=_start, initargs=(told,))
    try:
        with _alone():
            pending: set[Future[Report | None]] = {
                pool.submit(_in_process, trial) for trial in trials
            }
        while pending:
            finished, pending = wait(pending, timeout=POLL, return_when=FIRST_COMPLETED)
            if stop():
                told.set()
            for future in finished:
                report = future.result()
                if report is not None:
                    yield report
    except BrokenProcessPool as error:
        raise WorkerDied(
            f"servoed into {trials[0].out.parent}",
            "finished runs are kept, the same call goes on; fewer --jobs take less memory",
        ) from error
    finally:
        told.set()
        pool.shutdown(cancel_futures=True)


class _Laboratories:
    """The laboratory of the last trial, kept for the next one that asks for the same."""

    def __init__(self, life: ExitStack) -> None:
        self._life = life
        self._settings: LaboratorySettings | None = None
        self._lab: Laboratory | None = None

    def of(self, settings: LaboratorySettings) -> Laboratory:
        if self._lab is None or self._settings != settings:
            self._life.close()
            self._lab = self._life.enter_context(laboratory(settings))
            self._settings = settings
        return self._lab


def _carry_out(trial: Trial, kept: _Laboratories, stop: Callable[[], bool]) -> Report:
    with one_writer(trial.out):
        clear(trial.out)
        try:
            trace = run_trial(trial, kept.of(trial.laboratory), say=_silent, stop=stop)
        except DnetError as error:
            refuse(trial.out, error)
            return Report(trial, "refused", str(error))
    line = trace.reason
    if trace.steps:
        first, last = trace.steps[0].chamfer, trace.steps[-1].chamfer
        line = f"Chamfer {first * 1e3:.2f} mm -> {last * 1e3:.2f} mm"
    return Report(trial, trace.outcome, line)


def _silent(line: str) -> None:
    del line


@contextmanager
def _alone() -> Iterator[None]:
    """Start processes with one thread each, that leave Ctrl-C to this one."""
    added = {"OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"} - os.environ.keys()
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        os.environ.update(dict.fromkeys(added, "1"))
        yield
    finally:
        for name in added:
            del os.environ[name]
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


class _Process:
    """What this process was told, and what it keeps."""

    told: Any
    kept = _Laboratories(ExitStack())


def _start(told: Any) -> None:
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _Process.told = told


def _end_with_parent() -> None:
    parent = parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


def _in_process(trial: Trial) -> Report | None:
    if _Process.told.is_set():
        return None
    return _carry_out(trial, _Process.kept, _Process.told.is_set)
