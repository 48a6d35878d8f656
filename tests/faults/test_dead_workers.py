"""A process that works for another and is killed: said in one line, nothing finished is lost."""

import os
import signal
from dataclasses import dataclass, replace
from multiprocessing import parent_process
from pathlib import Path

import psutil
import pytest

from dnet.datasets.groups import GroupBatch
from dnet.datasets.index import INDEX, open_index
from dnet.datasets.loading import Share, load_groups
from dnet.datasets.stream import Stream, dead_workers
from dnet.errors import WorkerDied
from dnet.laboratory import LaboratorySettings
from dnet.training.neighbour_tables import NeighbourTables
from dnet.trials.batch import missing, run_trials
from dnet.trials.request import Trial
from tests.faults.children import elsewhere
from tests.recorders import rollout
from tests.training.deforming_box import SMALL
from tests.training.test_neighbour_tables import table_of


def kill_a_worker() -> None:
    """Kill one of the processes that this one works with."""
    children = psutil.Process().children(recursive=True)
    workers = [one for one in children if "spawn_main" in " ".join(one.cmdline())]
    workers[0].kill()


def write(folder: Path, count: int) -> Path:
    seen = rollout.frames(3, points=64)
    for number in range(count):
        rollout.write(folder / f"episode-{number:03d}.mcap", seen)
    return folder


def test_a_dead_reader_of_logs_leaves_no_index_and_the_next_call_makes_it(tmp_path: Path) -> None:
    write(tmp_path, 60)
    # Whoever opens it waits for ever: the others are not done when one of them is killed.
    endless = tmp_path / "episode-060.mcap"
    os.mkfifo(endless)

    def kill_at_the_first(done: int, _total: int) -> None:
        if done == 1:
            kill_a_worker()

    with pytest.raises(WorkerDied, match=r"read the logs in .* was killed.*run the same command"):
        open_index(tmp_path, workers=2, on_file=kill_at_the_first)
    assert not (tmp_path / INDEX).exists()
    endless.unlink()
    assert open_index(tmp_path, workers=1).files.height == 60


@dead_workers()
def kill_while_reading(stream: Stream[GroupBatch]) -> None:
    batches = iter(stream)
    next(batches)
    kill_a_worker()
    list(batches)


def lose_the_loader(folder: str) -> None:
    # Of many more batches than a worker reads ahead: it is not done when it is killed.
    stream = load_groups(write(Path(folder), 40), share=Share(workers=1))
    # Torch tells of a dead worker by a signal, wherever this process then is.
    with pytest.raises(WorkerDied, match=r"read ahead was killed.*fewer --workers"):
        kill_while_reading(stream)
    again = load_groups(Path(folder))
    again.load_state_dict(stream.state_dict())
    assert list(again)


@pytest.mark.slow
def test_a_dead_loader_worker_ends_the_stream_by_name(tmp_path: Path) -> None:
    elsewhere(lose_the_loader, tmp_path)


@dataclass(frozen=True)
class DyingTables(NeighbourTables):
    """Tables as large as the paper's, whose describers are killed in the fifth file."""

    ballast: bytes = bytes(2_000_000)
    """What 30,000 frames take; in the calls it hung Python before 3.11.5: python/cpython#94777."""

    def _put(self, file: int) -> int:
        if file == 4 and parent_process() is not None:
            os.kill(os.getpid(), signal.SIGKILL)
        return super()._put(file)


@pytest.mark.slow
def test_a_dead_describer_of_clouds_keeps_what_it_found(tmp_path: Path) -> None:
    tables = DyingTables(table_of(tmp_path, *range(12)), SMALL)
    with pytest.raises(WorkerDied, match=r"described the clouds.*what it found is kept"):
        tables.build(workers=2)
    # The files before it were taken up before it, one of them perhaps by the other process.
    assert 3 <= len(list(tmp_path.rglob("*.npy"))) < 12
    tables.build()
    assert len(list(tmp_path.rglob("*.npy"))) == 12


@pytest.mark.slow
def test_a_dead_evaluation_job_keeps_the_finished_runs(tmp_path: Path) -> None:
    lab = LaboratorySettings(points=512, world="quasistatic")
    plain = Trial("", tmp_path, controller="oracle", laboratory=lab, recording=False)
    asked = [replace(plain, goal=f"random:{n}", out=tmp_path / f"{n}") for n in range(4)]
    reports = run_trials(asked, jobs=2, stop=bool)
    first = next(iter(reports))
    kill_a_worker()
    with pytest.raises(WorkerDied, match=r"servoed into .* was killed.*fewer --jobs"):
        list(reports)
    left = missing(asked)
    assert first.trial not in left
    assert left
    list(run_trials(left, jobs=1, stop=bool))
    assert missing(asked) == []
