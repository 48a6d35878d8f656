"""However many recordings a process writes one after another, no thread of them stays."""

import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import psutil
import pytest
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from dnet.errors import Unwritten
from dnet.recorders.streams import open_stream, saved_stream, send_stream
from tests.recorders.rrd import rows

NAME = "dnet test"
LAYOUT = rrb.Blueprint(rrb.TimeSeriesView(name="heights"))


def saved(path: Path, *, sinks: bool) -> None:
    """Write a recording of one value and close it."""
    stream = open_stream(NAME, properties=False)
    if sinks:
        send_stream(stream, rr.FileSink(path), blueprint=LAYOUT)
        stream.log("height", rr.Scalars(3.0), static=True)
        stream.flush()
        stream.disconnect()
        return
    with saved_stream(stream, path, blueprint=LAYOUT):
        stream.log("height", rr.Scalars(3.0), static=True)


def test_a_stream_that_was_closed_leaves_no_threads(tmp_path: Path) -> None:
    saved(tmp_path / "first.rrd", sinks=False)
    before = psutil.Process().num_threads()
    for number in range(4):
        saved(tmp_path / f"{number}.rrd", sinks=number % 2 == 0)
    # One that was closed last waits for the next one to be opened.
    assert psutil.Process().num_threads() <= before + 2


def test_both_ways_write_the_values_and_the_layout(tmp_path: Path) -> None:
    for name, sinks in (("file", False), ("sinks", True)):
        path = tmp_path / f"{name}.rrd"
        saved(path, sinks=sinks)
        assert rows(path, "/height", "Scalars:scalars", timeline=None) == [(None, [3.0])]
        assert [entry.application_id for entry in RrdReader(path).blueprints()] == [NAME]


def test_a_recording_can_do_without_a_layout(tmp_path: Path) -> None:
    with saved_stream(open_stream(NAME), tmp_path / "plain.rrd", blueprint=None):
        pass
    assert not RrdReader(tmp_path / "plain.rrd").blueprints()


def test_of_what_fails_within_nothing_is_written(tmp_path: Path) -> None:
    stream = open_stream(NAME)
    with pytest.raises(ZeroDivisionError), saved_stream(stream, tmp_path / "no", blueprint=LAYOUT):
        stream.log("height", rr.Scalars(1 / 0))
    assert not list(tmp_path.iterdir())


@contextmanager
def largest_file(size: int) -> Iterator[None]:
    """Have the system refuse to let files of this process grow beyond so many bytes."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_file_that_takes_no_more_is_named_and_nothing_of_it_stays(tmp_path: Path) -> None:
    stream = open_stream(NAME, properties=False)
    points = np.random.default_rng(0).random((100_000, 3))
    with largest_file(100_000), pytest.raises(Unwritten, match=r"film\.rrd: File too large"):  # noqa: SIM117
        with saved_stream(stream, tmp_path / "film.rrd", blueprint=LAYOUT):
            stream.log("points", rr.Points3D(points))
    assert not list(tmp_path.iterdir())
