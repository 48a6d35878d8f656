"""The samples of the documentation run as they stand there."""

import subprocess
import sys
from pathlib import Path

import pytest

from dnet.cli import main

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
