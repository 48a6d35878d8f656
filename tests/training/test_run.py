import json
from dataclasses import asdict
from pathlib import Path

import pytest
import torch

from dnet.errors import BadCheckpoint, OccupiedOutput
from dnet.training.checkpoints import load, read_metrics
from dnet.training.loop import EpochDone, Result, new_network
from dnet.training.run import RunWriter, read_config
from dnet.training.scores import Errors, score
from tests.training.deforming_box import SMALL


def epoch(number: int, *, best: bool) -> EpochDone:
    scores = score(torch.ones(2, 3) * number, torch.eye(3)[:2])
    return EpochDone(number, 1.0, Errors(scores, None), best, 1e-3, 2.0, 0.5)


def test_a_run_holds_its_config_a_line_an_epoch_and_the_best_and_last_weights(
    tmp_path: Path,
) -> None:
    run = tmp_path / "runs" / "small"
    content = {"data": {"validation": ["episode-3"]}}
    writer = RunWriter(run, content)
    assert not run.exists()
    epochs = [epoch(1, best=True), epoch(2, best=False)]
    for seed, done in enumerate(epochs):
        writer.add(done, new_network(SMALL, seed=seed))
    assert read_config(run) == content
    lines = (run / "metrics.jsonl").read_text(encoding="utf-8").splitlines()
    assert [json.loads(line) for line in lines] == [asdict(done) for done in epochs]
    for name, seed in (("best", 0), ("last", 1)):
        file = run / f"{name}.safetensors"
        got, want = load(file).state_dict(), new_network(SMALL, seed=seed).state_dict()
        assert all(torch.equal(got[key], want[key]) for key in want)
        assert read_metrics(file) == asdict(epochs[seed])
    assert len(list(run.iterdir())) == 4


def test_finishing_makes_whole_what_an_interrupt_left_half_written(tmp_path: Path) -> None:
    writer = RunWriter(tmp_path, {"seed": 0})
    networks = [new_network(SMALL, seed=seed) for seed in range(2)]
    epochs = [epoch(1, best=True), epoch(2, best=False)]
    for done, network in zip(epochs, networks, strict=True):
        writer.add(done, network)
    whole = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    (tmp_path / "best.safetensors").unlink()
    with (tmp_path / "metrics.jsonl").open("a") as file:
        file.write('{"epo')
    best, last = (network.state_dict() for network in networks)
    writer.finish(Result(best, last, tuple(epochs), interrupted=True), SMALL)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == whole


def test_a_directory_that_holds_a_run_is_refused(tmp_path: Path) -> None:
    writer = RunWriter(tmp_path, {})
    writer.add(epoch(1, best=True), new_network(SMALL, seed=0))
    with pytest.raises(OccupiedOutput, match=r"already holds a run \(best.safetensors"):
        RunWriter(tmp_path, {})


def test_a_file_in_place_of_a_directory_is_refused(tmp_path: Path) -> None:
    (tmp_path / "run").write_text("")
    with pytest.raises(OccupiedOutput, match="already holds a file"):
        RunWriter(tmp_path / "run", {})


def test_a_directory_with_something_else_is_taken(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    RunWriter(tmp_path, {}).add(epoch(1, best=True), new_network(SMALL, seed=0))
    assert (tmp_path / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize(
    ("content", "complaint"),
    [(None, "does not exist"), ("{", "is unreadable"), ("[]", "is not a JSON object")],
)
def test_a_config_that_cannot_be_read_is_refused(
    tmp_path: Path, content: str | None, complaint: str
) -> None:
    if content is not None:
        (tmp_path / "config.json").write_text(content)
    with pytest.raises(BadCheckpoint, match=f"config.json {complaint}"):
        read_config(tmp_path)
