import sys
import time
from pathlib import Path

import pytest

from dnet.errors import NoPicture, NoScreen, ViewerFailed
from dnet.recorders.viewer import draw, show
from dnet.recorders.viewer_process import running
from tests.recorders.viewers import ends, stand_in


@pytest.fixture
def screen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DISPLAY", ":99")


def test_without_a_screen_a_window_is_refused_with_a_way_out(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(NoScreen, match="--screenshot"):
        show([tmp_path / "a.rrd"])


@pytest.mark.usefixtures("screen")
def test_the_viewer_gets_the_files_and_listens_to_this_machine_alone(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    log = tmp_path / "arguments"
    viewer = stand_in(tmp_path / "viewer", f'echo "$@" > {log}')
    monkeypatch.setenv("RERUN_CLI_PATH", str(viewer))
    show([tmp_path / "a.rrd", tmp_path / "b.rrd"])
    said = log.read_text().split()
    assert said[said.index("--bind") + 1] == "127.0.0.1"
    assert said[-2:] == [str(tmp_path / "a.rrd"), str(tmp_path / "b.rrd")]


@pytest.mark.usefixtures("screen")
def test_a_viewer_that_fails_is_reported(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("RERUN_CLI_PATH", str(stand_in(tmp_path / "viewer", "exit 3")))
    with pytest.raises(ViewerFailed, match="status 3"):
        show([tmp_path / "a.rrd"])


def test_a_viewer_that_cannot_draw_is_tried_three_times(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    tries = tmp_path / "tries"
    script = f"echo once >> {tries}; echo no graphics adapter; exit 1"
    monkeypatch.setenv("RERUN_CLI_PATH", str(stand_in(tmp_path / "viewer", script)))
    with pytest.raises(NoPicture, match=r"3 tries \(.*no graphics adapter\).*mesa-vulkan-drivers"):
        draw(tmp_path / "a.rrd", tmp_path / "a.png", seconds=None)
    assert len(tries.read_text().split()) == 3
    assert not (tmp_path / "a.png").exists()


@pytest.mark.parametrize("stubborn", ["", "trap '' TERM;"])
def test_no_child_of_the_viewer_outlives_it(tmp_path: Path, stubborn: str) -> None:
    number = tmp_path / "number"
    script = f"{stubborn} sleep 1000 & echo $! > {number}.new; mv {number}.new {number}; wait"
    launcher = f"import subprocess; subprocess.call({['/bin/sh', '-c', script]!r})"
    with running([sys.executable, "-c", launcher], None, {}):
        deadline = time.monotonic() + 10
        while not number.exists() and time.monotonic() < deadline:
            time.sleep(0.01)
    child = int(number.read_text())
    assert ends(child)
