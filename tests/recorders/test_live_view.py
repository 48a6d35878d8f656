"""A run is shown while it is written, and is written whole whatever becomes of the window."""

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import rerun_cli
from rerun.error_utils import RerunWarning

from dnet.errors import NoLiveView
from dnet.recorders import live_view
from dnet.recorders.live_view import LiveView
from dnet.recorders.rerun_run import RerunRun
from dnet.recorders.run_sinks import LOST, PATIENCE_SECONDS
from dnet.sim.urdf import psm_urdf
from tests.faults.children import elsewhere
from tests.recorders.rollout import ARMS, GRASP, frames, step
from tests.recorders.rrd import rows
from tests.recorders.viewers import alive, ends, stand_in

TIPS = np.linspace(GRASP, GRASP + 0.01, 5)


class Window:
    """Rerun itself in the viewer's place: what it is sent goes to a file instead of a window."""

    def __init__(self, folder: Path) -> None:
        self.seen, self._number = folder / "seen.rrd", folder / "number"
        rerun = Path(rerun_cli.__file__).with_name("rerun")
        script = f'echo $$ > {self._number}; exec {rerun} --save {self.seen} "$@"'
        self.program = stand_in(folder / "viewer", script)

    def signal(self, number: signal.Signals) -> None:
        os.kill(self.process, number)

    @property
    def process(self) -> int:
        return int(self._number.read_text())


@pytest.fixture
def window(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Window]:
    made = Window(tmp_path)
    monkeypatch.setenv("DISPLAY", ":99")
    monkeypatch.setenv("RERUN_CLI_PATH", str(made.program))
    yield made
    if made._number.exists() and alive(made.process):
        os.kill(made.process, signal.SIGKILL)


class Views:
    """Opens views, and knows them, to end them after the test."""

    def __init__(self) -> None:
        self.opened: list[LiveView] = []

    def __call__(self) -> LiveView:
        view = LiveView()
        self.opened.append(view)
        return view


@pytest.fixture
def views() -> Iterator[Views]:
    made = Views()
    yield made
    for view in made.opened:
        view.end()


def start(path: Path, views: Views, said: list[str]) -> RerunRun:
    return RerunRun(path, name="a run", arms=ARMS, urdf=psm_urdf(), view=views, say=said.append)


def write_step(run: RerunRun, index: int) -> None:
    seen = frames(4)
    run.log_step(index, step(seen[2 * index], seen[-1]), TIPS)


def check_whole(path: Path, steps: int) -> None:
    assert [file.name for file in path.parent.glob("run*")] == ["run.rrd"]
    clouds = rows(path, "/cloud/current", "Points3D:positions", timeline="step")
    assert [time for time, _ in clouds] == list(range(steps))


def wait_for_the_last(file: Path) -> None:
    """Wait until a file has grown and grows no more: a busy machine takes its time."""
    sizes: list[int] = []
    for _ in range(60):
        sizes.append(file.stat().st_size if file.exists() else 0)
        if sizes[-1] > 1000 and sizes[-3:] == [sizes[-1]] * 3:
            return
        time.sleep(0.25)


def test_the_window_is_sent_what_the_file_holds_and_outlives_the_run(
    window: Window, views: Views, tmp_path: Path
) -> None:
    said: list[str] = []
    with start(tmp_path / "run.rrd", views, said) as run:
        write_step(run, 0)
        write_step(run, 1)
    assert not said
    assert alive(window.process)
    check_whole(tmp_path / "run.rrd", 2)
    wait_for_the_last(window.seen)
    window.signal(signal.SIGINT)
    assert ends(window.process)
    entity, component = "/cloud/current", "Points3D:positions"
    written = rows(tmp_path / "run.rrd", entity, component, timeline="step")
    with pytest.warns(RerunWarning, match="no footer"):
        assert rows(window.seen, entity, component, timeline="step") == written


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGKILL])
def test_a_window_that_is_closed_leaves_the_run_alone(
    window: Window, views: Views, tmp_path: Path, how: signal.Signals
) -> None:
    said: list[str] = []
    with start(tmp_path / "run.rrd", views, said) as run:
        write_step(run, 0)
        window.signal(how)
        assert ends(window.process)
        write_step(run, 1)
        write_step(run, 2)
    assert said == [LOST]
    check_whole(tmp_path / "run.rrd", 3)


@pytest.mark.parametrize("size", [1, 20_000_000])
def test_a_window_that_hangs_holds_nothing_up(
    window: Window, views: Views, tmp_path: Path, size: int
) -> None:
    said: list[str] = []
    with start(tmp_path / "run.rrd", views, said) as run:
        write_step(run, 0)
        window.signal(signal.SIGSTOP)
        run.log_text("x" * size)
        write_step(run, 1)
        clock = time.monotonic()
    assert time.monotonic() - clock < PATIENCE_SECONDS + 10
    if size > 1:
        # What is small the system itself takes in, and nobody notices.
        assert said == [LOST]
        assert ends(window.process)
    check_whole(tmp_path / "run.rrd", 2)


def leave_a_window_that_hangs(folder: str) -> None:
    path, views, said = Path(folder), Views(), list[str]()
    with start(path / "run.rrd", views, said) as run:
        write_step(run, 0)
        views.opened[0].end = lambda: None  # type: ignore[method-assign]
        os.kill(int((path / "number").read_text()), signal.SIGSTOP)
        write_step(run, 1)
    assert said == [LOST]
    check_whole(path / "run.rrd", 2)


@pytest.mark.usefixtures("window")
def test_a_window_that_cannot_even_be_ended_holds_up_neither_the_run_nor_its_end(
    tmp_path: Path,
) -> None:
    elsewhere(leave_a_window_that_hangs, tmp_path)


def test_a_viewer_that_does_not_start_is_done_without(
    monkeypatch: pytest.MonkeyPatch, views: Views, tmp_path: Path
) -> None:
    monkeypatch.setenv("DISPLAY", ":99")
    broken = stand_in(tmp_path / "viewer", "echo no graphics adapter >&2; exit 3")
    monkeypatch.setenv("RERUN_CLI_PATH", str(broken))
    said: list[str] = []
    with start(tmp_path / "run.rrd", views, said) as run:
        write_step(run, 0)
    (line,) = said
    assert line.startswith("no live view: the viewer ended with status 3: no graphics adapter")
    assert "the run goes on" in line
    check_whole(tmp_path / "run.rrd", 1)


def test_a_viewer_that_never_listens_is_ended(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    number = tmp_path / "number"
    deaf = stand_in(tmp_path / "viewer", f"echo $$ > {number}; exec sleep 1000")
    monkeypatch.setenv("DISPLAY", ":99")
    monkeypatch.setenv("RERUN_CLI_PATH", str(deaf))
    monkeypatch.setattr(live_view, "START_SECONDS", 2.0)
    with pytest.raises(NoLiveView, match="not ready within 2 s"):
        LiveView()
    assert not number.exists() or ends(int(number.read_text()))


def test_without_a_screen_there_is_no_window(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(NoLiveView, match="there is no screen"):
        LiveView()
