"""A disk that fills up in the middle of each command: said in one line, and nothing lost.

The disk is a small tmpfs that nobody else sees, the error is the system's own ENOSPC.
"""

import json
import os
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from dnet.cli import main
from dnet.datasets.index import open_index
from dnet.datasets.reader import EpisodeReader
from dnet.training.checkpoints import load_any
from tests.faults.children import elsewhere
from tests.recorders import rollout

QUICK = ("--world", "quasistatic")
LEFT = 64 * 1024
"""Bytes that are left on a disk that somebody else fills."""


def small_disk(place: Path, size: str) -> str:
    return f"mount -t tmpfs -o size={size} tmpfs '{place}'"


@contextmanager
def filled(place: Path, sign: Path, *, lines: int = 0, left: int = LEFT) -> Iterator[None]:
    """Have somebody else fill the disk as soon as a file is there and has so many lines."""

    def fill() -> None:
        while not (sign.exists() and sign.read_bytes().count(b"\n") >= lines):
            time.sleep(0.001)
        disk = os.statvfs(place)
        with (place / "filler").open("wb") as file:
            os.posix_fallocate(file.fileno(), 0, max(1, disk.f_bavail * disk.f_frsize - left))

    threading.Thread(target=fill, daemon=True).start()
    yield


def refusal(*words: str) -> str:
    """Return the one line in which a command refuses to go on."""
    with pytest.raises(SystemExit) as ended:
        main(words)
    return str(ended.value)


def record_and_be_stopped(folder: str) -> None:
    place, data = Path(folder), Path(folder) / "data"
    asked = ["record", str(data), "--pairs", "4", "--shapes", "3", "--points", "512", *QUICK]
    with filled(place, data / "episode-0-00000.mcap"):
        assert "make room, choose another disk" in refusal(*asked)
    assert (data / "episode-0-00000.mcap").exists()
    for path in data.glob("*.mcap"):
        with EpisodeReader(path) as episode:
            assert episode.finished
            assert len(episode) == 4
    json.loads((data / "manifest.json").read_text())
    (place / "filler").unlink()
    main(asked)
    assert json.loads((data / "manifest.json").read_text())["finished"]


@pytest.mark.slow
def test_a_recording_keeps_what_was_finished_and_goes_on(tmp_path: Path) -> None:
    elsewhere(record_and_be_stopped, tmp_path, mount=small_disk(tmp_path, "16M"))


def train_and_be_stopped(folder: str) -> None:
    place, data, run = Path(folder), Path(folder) / "data", Path(folder) / "run"
    for number in range(3):
        seen = rollout.frames(3, seed=number, points=128)
        rollout.write(data / f"episode-{number}.mcap", seen)
    asked = ["train", "--from-mcap", str(data), "--out", str(run), "--device", "cpu"]
    with filled(place, run / "metrics.jsonl", lines=1):
        line = refusal(*asked, "--epochs", "10000")
    assert f"nothing can be written into {run}" in line
    for name in ("best", "last"):
        assert load_any(run / f"{name}.safetensors").config.points == 128
    assert not list(run.glob(".*"))
    (place / "filler").unlink()
    main([*asked, "--epochs", "2", "--resume"])
    assert (run / "errors.json").exists()


@pytest.mark.slow
def test_a_training_keeps_its_networks_and_goes_on(tmp_path: Path) -> None:
    elsewhere(train_and_be_stopped, tmp_path, mount=small_disk(tmp_path, "64M"))


def servo_and_be_stopped(folder: str) -> None:
    place, run = Path(folder), Path(folder) / "run"
    asked = ["servo", "--goal", "random", "--controller", "rrt", "--steps", "200", *QUICK]
    with filled(place, run / "latency.jsonl", lines=2, left=8_000_000):
        main([*asked, "--out", str(run)])
    with EpisodeReader(run / "run.mcap") as episode:
        result = episode.result or {}
        assert result["outcome"] == "disk_full"
        assert "make room" in result["reason"]
        assert len(episode.steps()) >= 2
    assert (run / "run.rrd").exists()
    assert not list(run.glob("*.part"))


@pytest.mark.slow
def test_a_servo_run_ends_whole_by_that_name(tmp_path: Path) -> None:
    elsewhere(servo_and_be_stopped, tmp_path, mount=small_disk(tmp_path, "64M"))


def export_and_be_refused(folder: str, source: str) -> None:
    place = Path(folder)
    for to in ("npz", "parquet", "hdf5", "lerobot"):
        asked = ["inspect", "export", source, "--to", to, "--out", str(place / "out")]
        assert f"nothing can be written into {place}: " in refusal(*asked)
        assert not list(place.iterdir())
    for words in (["plot", source, "--out"], ["stats", source, "--plot"]):
        line = refusal("inspect", *words, str(place / "picture.png"))
        assert "No space left on device" in line
        assert not list(place.iterdir())


@pytest.mark.slow
def test_an_export_and_a_picture_leave_nothing(tmp_path: Path) -> None:
    data, disk = tmp_path / "data", tmp_path / "disk"
    for number in range(2):
        seen = rollout.frames(3, seed=number, points=512)
        rollout.write(data / f"episode-{number}.mcap", seen)
    disk.mkdir()
    elsewhere(export_and_be_refused, disk, data, mount=small_disk(disk, "20k"))


def index_without_room(folder: str) -> None:
    place = Path(folder)
    for number in range(2):
        rollout.write(place / f"episode-{number}.mcap", rollout.frames(3, seed=number))
    (place / "now").touch()
    with filled(place, place / "now", left=0):
        while not (place / "filler").exists():
            time.sleep(0.001)
        time.sleep(0.1)
    assert open_index(place).frames.height == 10
    assert open_index(place).frames.height == 10
    assert {path.name for path in place.iterdir()} == {
        "episode-0.mcap",
        "episode-1.mcap",
        "filler",
        "now",
    }


@pytest.mark.slow
def test_a_dataset_is_indexed_without_room_for_the_index(tmp_path: Path) -> None:
    elsewhere(index_without_room, tmp_path, mount=small_disk(tmp_path, "1M"))
