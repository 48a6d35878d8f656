import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pytest
import torch

from dnet.errors import BadCheckpoint, OccupiedOutput, OtherRun
from dnet.training.checkpoints import load, read_metrics
from dnet.training.examples import stream_of
from dnet.training.frames import Frames
from dnet.training.objectives import MotionError
from dnet.training.parallel import Process
from dnet.training.progress import EpochDone
from dnet.training.run import RunWriter, read_config
from dnet.training.scores import Errors, score
from dnet.training.settings import TrainingSettings
from dnet.training.tasks import new_network
from dnet.training.training import Training
from tests.training.deforming_box import SMALL, box_frames

CONTENT: dict[str, Any] = {
    "network": {"size": "light"},
    "training": {"seed": 0},
    "data": {"unseen_episodes": ["episode-3"]},
}


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Frames:
    return box_frames(tmp_path_factory.mktemp("boxes"), [0, 1])


def begin(frames: Frames) -> Training:
    settings = TrainingSettings(epochs=2, groups=1, frames=3)
    stream = stream_of(frames, settings, process=Process())
    return Training(MotionError(new_network(SMALL, seed=0)), stream, settings)


def epoch(number: int, *, best: bool) -> EpochDone:
    errors = Errors(score(torch.ones(2, 3) * number, torch.eye(3)[:2]), None)
    return EpochDone(
        number,
        5 * number,
        80 * number,
        1.0,
        (2.0, 0.5),
        None,
        errors,
        best,
        1e-3,
        2.0,
        0.1,
        number / 2,
    )


def test_a_run_holds_its_config_a_line_an_epoch_and_the_best_and_last_network(
    tmp_path: Path,
) -> None:
    run = tmp_path / "runs" / "small"
    writer = RunWriter(run, CONTENT)
    assert not run.exists()
    epochs = [epoch(1, best=True), epoch(2, best=False)]
    for seed, done in enumerate(epochs):
        writer.add(done, new_network(SMALL, seed=seed))
    assert read_config(run) == CONTENT
    lines = (run / "metrics.jsonl").read_text(encoding="utf-8").splitlines()
    want = [json.loads(json.dumps(asdict(done))) for done in epochs]
    assert [json.loads(line) for line in lines] == want
    for name, seed in (("best", 0), ("last", 1)):
        file = run / f"{name}.safetensors"
        got, network = load(file).state_dict(), new_network(SMALL, seed=seed).state_dict()
        assert all(torch.equal(got[key], network[key]) for key in network)
        assert read_metrics(file) == want[seed]
    assert len(list(run.iterdir())) == 4
    assert writer.least == epochs[0].unseen_episodes.main.mse_mm2


def test_epochs_after_the_training_was_put_down_come_again(tmp_path: Path, frames: Frames) -> None:
    writer = RunWriter(tmp_path, CONTENT)
    writer.add(epoch(1, best=True), new_network(SMALL, seed=0))
    writer.save(begin(frames))
    writer.add(epoch(2, best=False), new_network(SMALL, seed=1))
    again = RunWriter(tmp_path, CONTENT, resume=True)
    assert [line["epoch"] for line in again.history] == [1]
    again.add(epoch(2, best=False), new_network(SMALL, seed=1))
    assert len((tmp_path / "metrics.jsonl").read_text().splitlines()) == 2


def test_a_run_that_is_not_there_yet_is_begun(tmp_path: Path, frames: Frames) -> None:
    writer = RunWriter(tmp_path / "run", CONTENT, resume=True)
    assert not writer.take_up(begin(frames))
    assert not writer.history


def test_other_settings_or_data_are_not_gone_on_with(tmp_path: Path, frames: Frames) -> None:
    RunWriter(tmp_path, CONTENT).save(begin(frames))
    other = CONTENT | {"training": {"seed": 1}}
    with pytest.raises(OtherRun, match="has seed 0, not 1; go on with the settings"):
        RunWriter(tmp_path, other, resume=True)


def test_a_state_of_another_network_is_refused(tmp_path: Path, frames: Frames) -> None:
    RunWriter(tmp_path, CONTENT).save(begin(frames))
    settings = TrainingSettings(epochs=2, groups=1, frames=3)
    network = new_network(SMALL, seed=0)
    network.head.output = torch.nn.Linear(32, 4)
    training = Training(
        MotionError(network), stream_of(frames, settings, process=Process()), settings
    )
    with pytest.raises(BadCheckpoint, match=r"state\.safetensors does not fit this training"):
        RunWriter(tmp_path, CONTENT, resume=True).take_up(training)


def test_a_cut_off_state_is_refused(tmp_path: Path, frames: Frames) -> None:
    RunWriter(tmp_path, CONTENT).save(begin(frames))
    state = tmp_path / "state.safetensors"
    state.write_bytes(state.read_bytes()[:-9])
    with pytest.raises(BadCheckpoint, match=r"state\.safetensors is not a whole"):
        RunWriter(tmp_path, CONTENT, resume=True)


def test_a_directory_that_holds_a_run_is_refused(tmp_path: Path) -> None:
    RunWriter(tmp_path, CONTENT).add(epoch(1, best=True), new_network(SMALL, seed=0))
    with pytest.raises(OccupiedOutput, match=r"already holds a run \(best.safetensors"):
        RunWriter(tmp_path, CONTENT)


def test_a_file_in_place_of_a_directory_is_refused(tmp_path: Path) -> None:
    (tmp_path / "run").write_text("")
    with pytest.raises(OccupiedOutput, match="already holds a file"):
        RunWriter(tmp_path / "run", CONTENT)


def test_a_directory_with_something_else_is_taken(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    RunWriter(tmp_path, CONTENT).add(epoch(1, best=True), new_network(SMALL, seed=0))
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
