from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tyro
from PIL import Image
from rerun.chunk import RrdReader
from rich.console import Console

from dnet.commands.play import Play
from dnet.commands.playlist import Choice, playlist
from dnet.errors import (
    BadCondition,
    DnetError,
    NoEpisodes,
    NoSuchEpisode,
    NothingMatches,
    TooFew,
    UnknownRecording,
    UnusedOption,
)
from dnet.recorders.episode import EpisodeWriter
from dnet.recorders.rerun_run import RerunRun
from dnet.sim.urdf import psm_urdf
from tests.recorders.rollout import ARMS, GRASP, frame, frames, meta, step, write, write_servo
from tests.recorders.rrd import rows


def run(*arguments: str | Path) -> None:
    tyro.cli(Play, args=[str(argument) for argument in arguments]).run()


def test_its_words_are_files_and_where_to_draw() -> None:
    words = ["a.mcap", "b.rrd", "--screenshot", "c.png", "--at", "1.5"]
    assert tyro.cli(Play, args=words) == Play(("a.mcap", "b.rrd"), screenshot=Path("c.png"), at=1.5)
    words = ["data", "--episode", "1,2", "--episode", "a", "--filter", "time > 3", "--limit", "4"]
    assert tyro.cli(Play, args=words) == Play(
        ("data",), episode=("1,2", "a"), filter="time > 3", limit=4
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


@pytest.mark.parametrize("name", ["run.rrd", "training.rrd"])
def test_the_directory_of_a_run_is_its_recording(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"")
    assert playlist((tmp_path,), Choice(), Console()) == [tmp_path / name]


def test_an_episode_is_saved_for_another_machine(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    seen = frames(2)
    run(write(tmp_path / "a.mcap", seen), "--save", tmp_path / "a.rrd")
    assert capsys.readouterr().out.strip() == str(tmp_path / "a.rrd")
    clouds = rows(tmp_path / "a.rrd", "/cloud/current", "Points3D:positions", timeline="frame")
    assert len(clouds) == len(seen)


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """A folder of four episodes, the third of which lifts the object most."""
    for number, height in enumerate((0.01, 0.02, 0.04, 0.0)):
        seen = [
            frame(0.0, np.zeros(3), "rest", points=8),
            frame(1.0, np.array([0.0, 0.0, height]), points=8),
        ]
        name = f"episode-0-{number:05}"
        with EpisodeWriter(
            tmp_path / "data" / f"{name}.mcap",
            replace(meta(name), index=number),
            arms=ARMS,
            attachments={},
        ) as writer:
            for one in seen:
                writer.add(one)
            writer.finish({})
    return tmp_path / "data"


def opened(data: Path, *options: str) -> list[str]:
    """Return the ids of the episodes of a folder that are saved with some options."""
    saved = data / "all.rrd"
    saved.unlink(missing_ok=True)
    run(data, *options, "--save", saved)
    found = RrdReader(saved)
    names = []
    for store in found.recordings():
        for chunk in found.stream(store=store).to_chunks():
            batch = chunk.to_record_batch()
            if "RecordingInfo:name" in batch.schema.names:
                names += batch.column("RecordingInfo:name").to_pylist()
    return sorted(name for (name,) in names)


@pytest.mark.parametrize(
    ("options", "numbers"),
    [
        ((), [0, 1, 2, 3]),
        (("--limit", "2"), [0, 1]),
        (("--episode", "2,episode-0-00000"), [0, 2]),
        (("--episode", "1", "--episode", "3"), [1, 3]),
        (("--filter", "motion_mm > 15"), [1, 2]),
        (("--filter", "kind = 'shape' and motion_z > 0.015", "--episode", "2"), [2]),
    ],
)
def test_a_folder_opens_the_episodes_that_are_chosen(
    data: Path, options: tuple[str, ...], numbers: list[int]
) -> None:
    assert opened(data, *options) == [f"episode-0-{number:05}" for number in numbers]


def test_what_is_left_out_of_a_folder_is_said(
    data: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    opened(data)
    assert capsys.readouterr().err == ""
    (data / "z.mcap").write_bytes(b"no episode")
    opened(data, "--limit", "3")
    broken, rest = capsys.readouterr().err.splitlines()
    assert broken.startswith("left out: z.mcap is not an MCAP file")
    assert rest.startswith(f"the first 3 of 4 episodes of {data}; --limit 4 opens all")


@pytest.mark.parametrize(
    ("options", "error", "why"),
    [
        (("--episode", "9"), NoSuchEpisode, r"no readable episode 9.*it has 4 \(episode-0-00000"),
        (("--filter", "motion_z > 1"), NothingMatches, "holds for none of 8 frames"),
        (("--filter", "height > 1"), BadCondition, "no condition on frames.*motion_z"),
        (("--filter", "motion_z +"), BadCondition, "no condition on frames"),
        (("--filter", "motion_z"), BadCondition, "no condition on frames"),
        (("--limit", "0"), TooFew, "limit is 0"),
    ],
)
def test_a_choice_that_leaves_nothing_is_refused(
    data: Path, options: tuple[str, ...], error: type[DnetError], why: str
) -> None:
    with pytest.raises(error, match=why):
        opened(data, *options)


def test_nothing_is_chosen_among_files(data: Path) -> None:
    with pytest.raises(UnusedOption, match="--filter does nothing without a directory"):
        run(data / "episode-0-00000.mcap", "--filter", "time > 0")


def test_a_folder_without_episodes_says_how_to_record(tmp_path: Path) -> None:
    with pytest.raises(NoEpisodes, match="dnet record"):
        run(tmp_path)
    (tmp_path / "a.mcap").write_bytes(b"no episode")
    with pytest.raises(NoEpisodes, match="that can be read"):
        run(tmp_path)


def test_other_files_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.png").touch()
    with pytest.raises(UnknownRecording):
        run(tmp_path / "a.png")


def test_the_directories_of_two_runs_are_shown_side_by_side(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folders = [tmp_path / "one", tmp_path / "other"]
    for folder in folders:
        folder.mkdir()
        write_servo(folder / "run.mcap")
    run(*folders, "--save", tmp_path / "both.rrd")
    assert capsys.readouterr().out.strip() == str(tmp_path / "both.rrd")
    for place in ("run_1", "run_2"):
        clouds = rows(
            tmp_path / "both.rrd", f"/{place}/cloud/current", "Points3D:positions", timeline="frame"
        )
        assert len(clouds) == 3


def test_a_run_without_a_recording_is_its_episode(tmp_path: Path) -> None:
    (tmp_path / "run.mcap").write_bytes(b"")
    assert playlist((tmp_path,), Choice(), Console()) == [tmp_path / "run.mcap"]
