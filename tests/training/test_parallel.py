"""Several processes, started as people start them, learn what one process learns."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import torch

from dnet.training.checkpoints import load
from dnet.training.parallel import Process, this_process
from tests.training.deforming_box import BoxEpisode, write_boxes

DNET = (sys.executable, "-c", "import sys; from dnet.cli import main; sys.exit(main())")
TOGETHER = (sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node")


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    boxes = [BoxEpisode(seed, ("rest", *("shape",) * 8)) for seed in range(5)]
    return write_boxes(tmp_path_factory.mktemp("data"), boxes)


def command_of(data: Path, out: Path, *options: str, processes: int = 1) -> list[str]:
    command = [*DNET, "train", "--from-mcap", str(data), "--out", str(out), "--epochs", "3"]
    # Slowly: in large steps Adam makes much of rounding, as it does in one process.
    command += ["--learning-rate", "1e-4", "--groups", "2", "--frames", "3", "--device", "cpu"]
    command += options
    return command if processes == 1 else [*TOGETHER, str(processes), "--no-python", *command]


def train(data: Path, out: Path, *, processes: int = 1) -> list[dict[str, Any]]:
    done = subprocess.run(
        command_of(data, out, processes=processes),
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"OMP_NUM_THREADS": "1"},
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("errors of the best network") == 1
    return [json.loads(line) for line in (out / "metrics.jsonl").read_text().splitlines()]


def test_two_processes_have_the_loss_curve_of_one_with_the_same_batch(
    data: Path, tmp_path: Path
) -> None:
    alone = train(data, tmp_path / "alone")
    together = train(data, tmp_path / "together", processes=2)
    assert [line["steps"] for line in together] == [line["steps"] for line in alone]
    # Rounding differs from the first batch on, and grows with every one that follows.
    assert together[0]["losses"] == pytest.approx(alone[0]["losses"], rel=1e-4)
    for one, other in zip(alone, together, strict=True):
        assert other["losses"] == pytest.approx(one["losses"], rel=5e-3)
        errors = [line["unseen_episodes"]["any_pair"]["mse_mm2"] for line in (one, other)]
        assert errors[1] == pytest.approx(errors[0], rel=5e-3)
    first, second = (load(tmp_path / name).state_dict() for name in ("alone", "together"))
    for name, weights in first.items():
        torch.testing.assert_close(second[name], weights, rtol=1e-2, atol=1e-3, msg=name)


def test_what_one_process_began_two_do_not_go_on_with(data: Path, tmp_path: Path) -> None:
    """They would come to batches in another order."""
    train(data, tmp_path / "run")
    command = command_of(data, tmp_path / "run", "--resume", processes=2)
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "the loader's batch_size is 1, that of the state to go on from is 2" in done.stderr


def test_a_process_knows_its_place_from_torchrun(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("RANK", "WORLD_SIZE", "LOCAL_RANK"):
        monkeypatch.delenv(name, raising=False)
    assert this_process() == Process(0, 1, 0)
    monkeypatch.setenv("RANK", "3")
    monkeypatch.setenv("WORLD_SIZE", "4")
    monkeypatch.setenv("LOCAL_RANK", "1")
    assert this_process() == Process(3, 4, 1)
    assert not this_process().first
