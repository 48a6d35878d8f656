"""Workers answer to the process that began them: they stop with it, and tell it what went wrong."""

import os
import pickle
import signal
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Generator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import psutil
import pytest

from dnet import errors
from dnet.datasets.reader import EpisodeReader
from dnet.errors import DnetError, NoReachableSurface, WorkerDied
from dnet.recording.dataset import record_missing, recording
from dnet.recording.folder_store import FolderStore
from dnet.recording.manifest import Manifest, open_manifest
from dnet.recording.pair import PairReport
from dnet.recording.processes import record_in_processes
from dnet.recording.request import RecordingRequest
from dnet.sim.scenes import Workspace
from tests.recording.synthetic import REQUEST, contents, request

RECORD = """
import signal, sys
# A background job inherits SIGINT as ignored: Python's own handler is put back.
signal.signal(signal.SIGINT, signal.default_int_handler)
from dnet.cli import main
if __name__ == "__main__":
    main()
"""


def ignore(shapes: int) -> None:
    """Progress is not what is tested."""


def start(
    manifest: Manifest, *, workers: int = 2, progress: Callable[[int], None] = ignore
) -> Generator[PairReport, None, None]:
    return record_in_processes(
        manifest.request, manifest.missing(), manifest.store, progress, workers=workers
    )


def command(out: Path, asked: RecordingRequest) -> "subprocess.Popen[bytes]":
    """Begin the request with the command, in a process group of its own."""
    options = {"pairs": asked.pairs, "shapes": asked.shapes, "seed": asked.seed, "points": 64}
    texts = [text for name, value in options.items() for text in (f"--{name}", str(value))]
    texts += ["--world", "quasistatic", "--workers", "2"]
    # A file, not a pipe: the end of a pipe would wait for workers that outlive their parent.
    with out.with_suffix(".log").open("w") as log:
        return subprocess.Popen(
            [sys.executable, "-c", RECORD, "record", out, *texts],
            stderr=log,
            start_new_session=True,
        )


def wait_until(holds: Callable[[], bool], process: "subprocess.Popen[bytes] | None" = None) -> None:
    deadline = time.monotonic() + 120
    while not holds():
        assert process is None or process.poll() is None, "ended too early"
        assert time.monotonic() < deadline
        time.sleep(0.02)


def workers_of(process: int) -> list[psutil.Process]:
    return [
        child
        for child in psutil.Process(process).children()
        if any("spawn_main" in part for part in child.cmdline())
    ]


class Enough(Exception):
    """What stops a recording, as Ctrl-C does."""


def test_what_stops_the_parent_ends_the_workers_and_closes_their_files(tmp_path: Path) -> None:
    def stop_at_the_first_shape(shapes: int) -> None:
        if shapes:
            raise Enough

    with recording(FolderStore(tmp_path), request(4, shapes=500)) as manifest:
        with pytest.raises(Enough):
            list(start(manifest, progress=stop_at_the_first_shape))
        assert workers_of(os.getpid()) == []
    parts = list(tmp_path.glob("*.mcap*"))
    assert parts
    for path in parts:
        with EpisodeReader(path) as episode:
            assert not episode.finished
            assert 1 < len(episode) < 500


def test_a_killed_worker_is_said_to_be_dead_and_the_rest_goes_on_later(tmp_path: Path) -> None:
    one, other = FolderStore(tmp_path / "one"), FolderStore(tmp_path / "other")
    asked = request(4)
    with recording(one, asked) as manifest:
        with closing(start(manifest)) as reports:
            first = next(reports)
            manifest.add(first)
            os.kill(first.worker, signal.SIGKILL)
            with pytest.raises(WorkerDied, match=one.name):
                deque(map(manifest.add, reports))
        assert workers_of(os.getpid()) == []
    left = open_manifest(one, asked).missing()
    assert 0 < len(left) < 4
    for store in (one, other):
        with recording(store, asked) as manifest:
            record_missing(manifest, progress=ignore)
    assert contents(one.folder) == contents(other.folder)


def test_workers_end_when_their_parent_is_killed(tmp_path: Path) -> None:
    out = tmp_path / "data"
    process = command(out, request(50, shapes=5))
    wait_until(lambda: any(out.glob("*.mcap")), process)
    workers = workers_of(process.pid)
    assert len(workers) == 2
    process.kill()
    process.wait(60)
    _, alive = psutil.wait_procs(workers, timeout=60)
    for worker in alive:
        worker.kill()
    assert alive == []
    before = contents(out)
    # The folder is free again, and what was finished is taken up.
    with recording(FolderStore(out), request(50, shapes=5)) as manifest:
        assert len(manifest.missing()) == 50 - len(list(out.glob("*.mcap")))
    after = contents(out)
    assert any(name.endswith(".mcap") for name in before)
    assert all(after[name] == before[name] for name in before if ".mcap" in name)


def test_ctrl_c_in_a_terminal_is_quiet_even_while_the_workers_start(tmp_path: Path) -> None:
    """A terminal sends it to the whole process group; only the parent says what it means."""
    process = command(tmp_path / "data", REQUEST)
    # More than Python alone takes, less than the laboratory: they import.
    wait_until(
        lambda: [one.memory_info().rss > 5e7 for one in workers_of(process.pid)] == [True, True],
        process,
    )
    os.killpg(process.pid, signal.SIGINT)
    assert process.wait(120) == 130
    said = (tmp_path / "data.log").read_text()
    assert "interrupted; what was finished is kept" in said
    assert "Traceback" not in said
    assert "KeyboardInterrupt" not in said


def test_what_a_worker_refuses_arrives_as_it_is(tmp_path: Path) -> None:
    nowhere = replace(
        REQUEST, laboratory=replace(REQUEST.laboratory, workspace=Workspace(clearance=1.0))
    )
    with (
        recording(FolderStore(tmp_path), nowhere) as manifest,
        pytest.raises(NoReachableSurface, match="lie 1000 mm from the held end"),
    ):
        list(start(manifest))


@pytest.mark.parametrize(
    "kind",
    [
        kind
        for kind in vars(errors).values()
        if isinstance(kind, type) and issubclass(kind, DnetError)
    ],
)
def test_every_error_travels_between_processes(kind: type[DnetError]) -> None:
    error = kind.__new__(kind)
    error.args = ("what it was, and the way out",)
    arrived = pickle.loads(pickle.dumps(error))  # noqa: S301
    assert type(arrived) is kind
    assert str(arrived) == str(error) == "what it was, and the way out"
