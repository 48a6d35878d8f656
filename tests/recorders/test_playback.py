import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from rerun.chunk import RrdReader

from dnet.datasets.reader import EpisodeReader
from dnet.errors import (
    BadEpisode,
    MissingPath,
    NoPicture,
    OccupiedOutput,
    TooFew,
    UnknownRecording,
    Unmerged,
)
from dnet.recorders.episode import EpisodeWriter
from dnet.recorders.playback import Progress, play
from dnet.recorders.replay import RecordedEpisode
from dnet.recorders.rerun_run import RerunRun
from dnet.sim.urdf import psm_urdf
from dnet.types import Place
from tests.recorders.rollout import ARMS, frames, meta, step, write, write_servo
from tests.recorders.rrd import rows

Box = tuple[float, float, float, float]


def share(picture: Path, low: tuple[int, int, int], high: tuple[int, int, int], box: Box) -> float:
    """Return the share of pixels between two colours in a part of a picture."""
    pixels = np.asarray(Image.open(picture).convert("RGB")).astype(int)
    height, width, _ = pixels.shape
    left, top, right, bottom = box
    part = pixels[int(top * height) : int(bottom * height), int(left * width) : int(right * width)]
    return float(((part >= low) & (part <= high)).all(axis=2).mean())


SCENE: Box = (0.0, 0.1, 0.6, 0.95)
UPPER_LEFT: Box = (0.0, 0.1, 0.3, 0.4)
UPPER_RIGHT: Box = (0.3, 0.1, 0.6, 0.4)
NOTICES: Box = (0.78, 0.0, 1.0, 0.03)
FAR = (130, 0, 0), (230, 80, 60)
GREEN = (20, 110, 40), (90, 220, 120)
STEEL = (110, 110, 110), (240, 240, 240)


def test_a_picture_shows_the_object_the_goal_and_both_arms(tmp_path: Path) -> None:
    seen = frames(3, points=1024)
    attachments = {"psm.urdf": psm_urdf().encode()}
    with EpisodeWriter(
        tmp_path / "a.mcap", meta("a"), arms=ARMS, attachments=attachments
    ) as writer:
        writer.set_goal(seen[-1].cloud)
        for index, one in enumerate(seen[:3:2]):
            writer.add_step(step(one, seen[-1]), index)
        writer.finish({})
    picture = tmp_path / "new" / "a.png"
    play([tmp_path / "a.mcap"], open_episode=EpisodeReader, screenshot=picture)
    # What is far from the goal is red.
    assert share(picture, *FAR, SCENE) > 0.003
    assert share(picture, *GREEN, SCENE) > 0.005
    assert share(picture, *STEEL, UPPER_LEFT) > 0.01
    assert share(picture, *STEEL, UPPER_RIGHT) > 0.01
    assert share(picture, *STEEL, NOTICES) < 0.01


def test_a_saved_recording_holds_the_episode(tmp_path: Path) -> None:
    seen = frames(3)
    saved = tmp_path / "new" / "a.rrd"
    play([write(tmp_path / "a.mcap", seen)], open_episode=EpisodeReader, save=saved)
    assert len(rows(saved, "/cloud/current", "Points3D:positions", timeline="frame")) == len(seen)


def test_several_episodes_are_saved_as_recordings_of_one_application_with_one_layout(
    tmp_path: Path,
) -> None:
    files = [write(tmp_path / f"{name}.mcap", frames(2)) for name in "abc"]
    told: list[tuple[int, int]] = []

    @contextmanager
    def watched() -> Iterator[Progress]:
        yield lambda done, total: told.append((done, total))

    play(
        # The same file twice is one recording.
        [*files, files[0]],
        open_episode=EpisodeReader,
        save=tmp_path / "all.rrd",
        watched=watched(),
    )
    found = RrdReader(tmp_path / "all.rrd")
    assert [entry.application_id for entry in found.recordings()] == ["dnet record"] * 3
    assert len({entry.recording_id for entry in found.recordings()}) == 3
    assert [entry.application_id for entry in found.blueprints()] == ["dnet record"]
    assert told == [(0, 3), (1, 3), (2, 3), (3, 3)]
    assert not list(tmp_path.glob("*.part"))


def test_recordings_that_rerun_does_not_merge_leave_nothing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    files = [write(tmp_path / f"{name}.mcap", frames(1)) for name in "ab"]
    monkeypatch.setenv("RERUN_CLI_PATH", "/bin/false")
    with pytest.raises(Unmerged, match=r"could not write 2 recordings into .*all\.rrd"):
        play(files, open_episode=EpisodeReader, save=tmp_path / "all.rrd")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.mcap", "b.mcap"]


def test_an_existing_recording_is_not_overwritten(tmp_path: Path) -> None:
    episode = write(tmp_path / "a.mcap", frames(2))
    saved = tmp_path / "a.rrd"
    saved.write_bytes(b"older")
    with pytest.raises(OccupiedOutput):
        play([episode], open_episode=EpisodeReader, save=saved)
    assert saved.read_bytes() == b"older"


def test_unfinished_recordings_play_too(tmp_path: Path) -> None:
    episode = write_servo(tmp_path / "a.mcap")
    play([episode], open_episode=EpisodeReader, save=tmp_path / "a.rrd")
    for name in ("a.mcap", "a.rrd"):
        part = tmp_path / f"{name}.part"
        shutil.copyfile(tmp_path / name, part)
        play([part], open_episode=EpisodeReader, save=tmp_path / f"of-{name}.rrd")
        found = rows(
            tmp_path / f"of-{name}.rrd", "/cloud/current", "Points3D:positions", timeline="frame"
        )
        assert len(found) == 3


def test_what_a_killed_run_left_plays_too(tmp_path: Path) -> None:
    seen = frames(2)
    run = RerunRun(tmp_path / "run.rrd", name="run", arms=ARMS, urdf=psm_urdf())
    run.log_step(0, step(seen[0], seen[-1]), None)
    sound = len(run.part.read_bytes())
    run.log_step(1, step(seen[-1], seen[-1]), None)
    left = tmp_path / "left.rrd.part"
    # The kill came in the middle of the second step.
    left.write_bytes(run.part.read_bytes()[: sound + 3000])
    run.close()
    play([left], open_episode=EpisodeReader, save=tmp_path / "left.rrd")
    found = rows(tmp_path / "left.rrd", "/cloud/current", "Points3D:positions", timeline="sim_time")
    assert [time for time, _ in found] == [0.0]


def test_an_episode_is_closed_whatever_comes(tmp_path: Path) -> None:
    opened: list[EpisodeReader] = []

    def open_episode(path: Place) -> RecordedEpisode:
        opened.append(EpisodeReader(path))
        return opened[-1]

    play(
        [write(tmp_path / "a.mcap", frames(2))], open_episode=open_episode, save=tmp_path / "a.rrd"
    )
    with pytest.raises(ValueError, match="released"):
        opened[0].lines()


def test_several_files_open_in_one_viewer(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    seen = tmp_path / "seen"
    viewer = tmp_path / "viewer"
    viewer.write_text(
        '#!/bin/sh\nfor a in "$@"; do case $a in '
        f"*.rrd) cp --backup=numbered $a {seen};; esac; done\n"
    )
    viewer.chmod(0o755)
    seen.mkdir()
    monkeypatch.setenv("DISPLAY", ":99")
    monkeypatch.setenv("RERUN_CLI_PATH", str(viewer))
    for place in ("one", "two"):
        write(tmp_path / place / "a.mcap", frames(2))
    files = [tmp_path / "one" / "a.mcap", tmp_path / "two" / "a.mcap"]
    play(files, open_episode=EpisodeReader)
    assert sorted(path.name for path in seen.iterdir()) == ["a.rrd", "a.rrd.~1~"]


def test_nothing_to_play_is_refused() -> None:
    with pytest.raises(TooFew):
        play([], open_episode=EpisodeReader)


@pytest.mark.parametrize("name", ["a.png", "a", "a.mcap.zip", "a.part"])
def test_other_files_are_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / name).touch()
    with pytest.raises(UnknownRecording, match=r"not in \.mcap or \.rrd"):
        play([tmp_path / name], open_episode=EpisodeReader)


def test_a_missing_file_is_named_and_its_unfinished_one_is_offered(tmp_path: Path) -> None:
    with pytest.raises(MissingPath, match=r"a\.mcap does not exist; `dnet inspect ls"):
        play([tmp_path / "a.mcap"], open_episode=EpisodeReader)
    with pytest.raises(MissingPath, match="runs/none does not exist"):
        play([tmp_path / "runs" / "none"], open_episode=EpisodeReader)
    (tmp_path / "a.mcap.part").touch()
    with pytest.raises(MissingPath, match=r"did not finish; play what there is of it as .*\.part"):
        play([tmp_path / "a.mcap"], open_episode=EpisodeReader)


def test_a_run_behind_a_url_is_refused_with_a_way_out() -> None:
    with pytest.raises(MissingPath, match="copy it to this machine"):
        play(["s3://bucket/run.rrd"], open_episode=EpisodeReader)


@pytest.mark.parametrize(
    ("name", "why"), [("a.mcap", "not an MCAP file"), ("a.rrd", "not a Rerun recording")]
)
def test_a_name_alone_makes_no_recording(tmp_path: Path, name: str, why: str) -> None:
    (tmp_path / name).write_bytes(b"something else altogether")
    with pytest.raises(BadEpisode, match=why):
        play([tmp_path / name], open_episode=EpisodeReader)


def test_no_picture_is_left_where_none_was_drawn(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("RERUN_CLI_PATH", "/bin/false")
    with pytest.raises(NoPicture):
        play(
            [write(tmp_path / "a.mcap", frames(2))],
            open_episode=EpisodeReader,
            screenshot=tmp_path / "a.png",
        )
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]
