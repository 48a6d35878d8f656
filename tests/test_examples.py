"""The samples of the documentation run as they stand there."""

import os
import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest

from dnet.cli import main
from dnet.types import Outcome

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("examples") / "data"
    main(["record", str(out), "--pairs", "2", "--shapes", "4", "--world", "quasistatic"])
    return out


def printed(example: str, *arguments: object) -> str:
    """Return what an example prints."""
    command = [sys.executable, str(EXAMPLES / f"{example}.py"), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def test_an_episode_is_read(data: Path) -> None:
    lines = printed("read_episode", data / "episode-0-00000.mcap").splitlines()
    assert lines[0] == "0 rest: 2048 points, grasp moved 0.0 mm"
    assert len(lines) == 5


def test_the_network_that_ships_is_asked(data: Path) -> None:
    assert printed("predict_motion", data / "episode-0-00000.mcap").startswith("predicted [")


def test_batches_are_streamed(data: Path) -> None:
    assert "2048, 3) -> (" in printed("train_on_batches", data)


def test_a_controller_of_ones_own_drives_a_run(data: Path, tmp_path: Path) -> None:
    goal = f"{data / 'episode-0-00001.mcap'}:1"
    assert printed("controller", goal, tmp_path / "run").splitlines()[-1] == "converged"
    assert (tmp_path / "run" / "run.mcap").is_file()


@pytest.mark.slow
def test_a_network_of_ones_own_is_trained_and_drives_a_run(data: Path, tmp_path: Path) -> None:
    goal = f"{data / 'episode-0-00001.mcap'}:1"
    lines = printed("own_network", data, goal, tmp_path / "run").splitlines()
    assert float(lines[0].split()[0]) < 5000
    assert lines[-1] in get_args(Outcome)
    assert (tmp_path / "run" / "run.mcap").is_file()


def ran(script: str, *arguments: object) -> str:
    """Return what a shell script prints, with the `dnet` of this Python first on the way."""
    way = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    return subprocess.run(
        ["bash", str(EXAMPLES / f"{script}.sh"), *map(str, arguments)],
        env=os.environ | {"PATH": way, "COLUMNS": "120"},
        capture_output=True,
        text=True,
        check=True,
    ).stdout


@pytest.mark.slow
def test_logs_of_ones_own_are_learned_from(data: Path, tmp_path: Path) -> None:
    assert "2 episodes, no faults" in ran("own_logs", data, tmp_path)
    assert (tmp_path / "network" / "best.safetensors").is_file()
    assert (tmp_path / "servo" / "run.mcap").is_file()


@pytest.mark.slow
def test_an_object_of_ones_own_is_recorded_and_learned_from(tmp_path: Path) -> None:
    told = ran("own_object", tmp_path)
    assert "unseen episodes" in told
    assert len([*(tmp_path / "data").glob("*.mcap")]) == 4
