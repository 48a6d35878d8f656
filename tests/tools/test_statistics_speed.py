import json
from pathlib import Path

import pytest

from dnet.tools.statistics_speed import TIMINGS, read_speed


def line(
    ended: str,
    *,
    worker: int = 0,
    shapes: int = 60,
    seconds: float = 30.0,
    memory: int | None = None,
) -> str:
    noted = {} if memory is None else {"memory": memory}
    return json.dumps(
        noted
        | {
            "episode": "episode-0-00000",
            "shapes": shapes,
            "seconds": seconds,
            "cpu_seconds": seconds / 2,
            "worker": worker,
            "ended": f"2026-01-01T{ended}+00:00",
        }
    )


def note(directory: Path, *lines: str) -> Path:
    (directory / TIMINGS).write_text("\n".join(lines))
    return directory


def test_nothing_noted_is_nothing_known(tmp_path: Path) -> None:
    assert read_speed(tmp_path) is None
    assert read_speed(note(tmp_path, "", "{")) is None


def test_one_worker_is_as_fast_as_the_machine(tmp_path: Path) -> None:
    speed = read_speed(note(tmp_path, line("10:00:30"), line("10:01:00")))
    assert speed is not None
    assert (speed.episodes, speed.shapes) == (2, 120)
    assert speed.worker == speed.machine == speed.workers[0].pace
    assert speed.worker.shapes_per_second == 2.0
    assert speed.worker.hours == 60 / 3600
    assert speed.cpu.shapes_per_second == 4.0


def test_workers_at_once_add_up(tmp_path: Path) -> None:
    lines = [line(f"10:{minute:02}:00", worker=worker) for minute in (1, 2) for worker in (7, 8, 9)]
    speed = read_speed(note(tmp_path, *lines))
    assert speed is not None
    assert speed.worker.shapes_per_second == 2.0
    assert speed.machine.shapes_per_second == 6.0
    assert speed.machine.hours == 60 / 3600
    assert [worker.worker for worker in speed.workers] == [7, 8, 9]
    assert [worker.shapes for worker in speed.workers] == [120] * 3


def test_overlapping_episodes_are_covered_once(tmp_path: Path) -> None:
    lines = [
        line("10:01:00", worker=1, seconds=60.0),
        line("10:01:10", worker=2, seconds=60.0),
        line("10:00:40", worker=3, seconds=5.0),
    ]
    speed = read_speed(note(tmp_path, *lines))
    assert speed is not None
    assert speed.machine.hours == pytest.approx(70 / 3600)


def test_a_pause_between_two_runs_does_not_count(tmp_path: Path) -> None:
    resumed = [line("10:00:30", worker=100), line("18:00:30", worker=200)]
    speed = read_speed(note(tmp_path, *resumed))
    assert speed is not None
    assert speed.machine.hours == 60 / 3600
    assert speed.machine.shapes_per_second == 2.0


def test_lines_that_were_cut_off_are_counted_apart(tmp_path: Path) -> None:
    whole = line("10:00:30")
    broken = [
        whole[:-10],
        whole[:20] + whole,
        whole.replace("30.0", "NaN"),
        whole.replace("30.0", "-30.0"),
        whole.replace('"2026', '"never'),
        "[]",
    ]
    speed = read_speed(note(tmp_path, whole, *broken))
    assert speed is not None
    assert speed.episodes == 1
    assert speed.unreadable_lines == len(broken)


def test_no_time_at_all_gives_no_speed(tmp_path: Path) -> None:
    speed = read_speed(note(tmp_path, line("10:00:00", seconds=0.0)))
    assert speed is not None
    assert speed.machine.shapes_per_second is None


def test_memory_is_told_of_the_first_and_the_last_episode_of_each_worker(tmp_path: Path) -> None:
    lines = [
        line("10:00:30", memory=100),
        line("10:01:00", memory=300),
        line("10:01:30", memory=110),
    ]
    speed = read_speed(note(tmp_path, *lines, line("10:01:30", worker=1)))
    assert speed is not None
    noted = [(worker.first_bytes, worker.last_bytes) for worker in speed.workers]
    assert noted == [(100, 110), (None, None)]
