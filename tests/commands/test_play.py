from pathlib import Path

import pytest
import tyro
from PIL import Image

from dnet.commands.play import Play
from dnet.errors import UnknownRecording
from dnet.recorders.rerun_run import RerunRun
from dnet.sim.urdf import psm_urdf
from tests.recorders.rollout import ARMS, GRASP, frames, step, write
from tests.recorders.rrd import rows


def run(*arguments: str | Path) -> None:
    tyro.cli(Play, args=[str(argument) for argument in arguments]).run()


def test_its_words_are_files_and_where_to_draw() -> None:
    words = ["a.mcap", "b.rrd", "--screenshot", "c.png", "--at", "1.5"]
    assert tyro.cli(Play, args=words) == Play(
        (Path("a.mcap"), Path("b.rrd")), screenshot=Path("c.png"), at=1.5
    )


def test_a_run_is_drawn_at_a_given_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    seen = frames(2, points=512)
    with RerunRun(tmp_path / "run.rrd", name="run", arms=ARMS, urdf=psm_urdf()) as recording:
        recording.log_goal(seen[-1].cloud)
        recording.log_step(0, step(seen[0], seen[-1]), GRASP[None])
        recording.log_step(1, step(seen[-1], seen[-1], planned=False), None)
    run(tmp_path / "run.rrd", "--screenshot", tmp_path / "run.png", "--at", "0.5")
    assert capsys.readouterr().out.strip() == str(tmp_path / "run.png")
    with Image.open(tmp_path / "run.png") as picture:
        assert picture.format == "PNG"
        assert picture.size == (1600, 900)
        # Many colours: points, arms and curves, not an empty window.
        colors = picture.convert("RGB").getcolors(1600 * 900)
        assert colors is not None
        assert len(colors) > 500


def test_an_episode_is_saved_for_another_machine(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    seen = frames(2)
    run(write(tmp_path / "a.mcap", seen), "--save", tmp_path / "a.rrd")
    assert capsys.readouterr().out.strip() == str(tmp_path / "a.rrd")
    clouds = rows(tmp_path / "a.rrd", "/cloud/current", "Points3D:positions", timeline="frame")
    assert len(clouds) == len(seen)


def test_other_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(UnknownRecording):
        run(tmp_path / "a.png")
