import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from dnet.commands.train import Train
from dnet.datasets.reader import EpisodeReader
from dnet.errors import (
    BadCheckpoint,
    BadEpisode,
    DnetError,
    MissingPath,
    NoDevice,
    NoEpisodes,
    NotAFraction,
    OccupiedOutput,
    OtherRun,
    TooFew,
    TooShort,
    UnusedOption,
)
from dnet.training.checkpoints import load, load_any, read_metrics
from dnet.training.run import read_config
from tests.recorders import rollout

POINTS = 136


@pytest.fixture(scope="module")
def episodes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    directory = tmp_path_factory.mktemp("episodes")
    for index in range(3):
        seen = rollout.frames(5, seed=index, points=POINTS)
        rollout.write(directory / f"episode-{index}.mcap", seen)
    return directory


@pytest.fixture(scope="module")
def run(episodes: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("runs") / "small"
    Train(from_mcap=episodes, out=out, epochs=3, device="cpu").run()
    return out


def test_a_run_leaves_its_config_its_metrics_and_two_networks(run: Path) -> None:
    assert sorted(path.name for path in run.iterdir()) == [
        "MODEL_CARD.md",
        "best.safetensors",
        "config.json",
        "errors.json",
        "last.safetensors",
        "metrics.jsonl",
        "state.safetensors",
        "training.rrd",
    ]
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    assert [line["epoch"] for line in lines] == [1, 2, 3]
    assert all(line["unseen_episodes"]["any_pair"]["pairs"] == 20 for line in lines)


def test_the_config_names_the_episodes_on_each_side(run: Path) -> None:
    data = read_config(run)["data"]
    assert len(data["unseen_episodes"]) == 1
    every = sorted(data["training"] + data["unseen_episodes"])
    assert every == [f"episode-{i}" for i in range(3)]


def test_the_best_network_has_the_error_that_the_metrics_say(run: Path, episodes: Path) -> None:
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    least = min(line["unseen_episodes"]["any_pair"]["mse_mm2"] for line in lines)
    model = load(run)
    (held_out,) = read_config(run)["data"]["unseen_episodes"]
    with EpisodeReader(episodes / f"{held_out}.mcap") as episode:
        shapes = [index for index, kind in enumerate(episode.kinds) if kind != "way"]
        squares = [
            np.square(
                1000
                * (
                    model.predict(episode.cloud(current), episode.cloud(goal))
                    - (episode.grasps[goal] - episode.grasps[current])
                )
            ).mean()
            for current in shapes
            for goal in shapes
            if current != goal
        ]
    assert np.mean(squares) == pytest.approx(least, rel=1e-3)


def test_the_same_seed_trains_the_same_network(run: Path, episodes: Path, tmp_path: Path) -> None:
    Train(from_mcap=episodes, out=tmp_path / "again", epochs=3, device="cpu").run()
    one, other = load(run).state_dict(), load(tmp_path / "again").state_dict()
    assert all(torch.equal(one[name], other[name]) for name in one)


def test_the_closing_table_and_the_data_are_told(
    episodes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Train(from_mcap=episodes, out=tmp_path / "run", epochs=1, size="light", norm="batch").run()
    told = capsys.readouterr()
    assert "2 episodes to train on, 1 to validate on;" in " ".join(told.err.split())
    assert "no motion" in told.out
    assert "unseen" in told.out
    assert load(tmp_path / "run").config.norm == "batch"


def test_time_limits_a_training_whatever_its_epochs(episodes: Path, tmp_path: Path) -> None:
    Train(from_mcap=episodes, out=tmp_path / "run", epochs=10**6, minutes=0.01).run()
    assert load(tmp_path / "run").config.points == POINTS


def begun(episodes: Path, out: Path) -> subprocess.Popen[str]:
    """Start a training and wait until it has learned for some epochs.

    On one thread, like the trainings of this process: sums on two end in other bits.
    """
    code = "import sys; from dnet.cli import main; sys.exit(main())"
    words = ["train", "--from-mcap", str(episodes), "--out", str(out), "--epochs", "30"]
    process = subprocess.Popen(
        [sys.executable, "-c", code, *words, "--device", "cpu"],
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )
    while not (out / "metrics.jsonl").exists():
        assert process.poll() is None, process.stderr and process.stderr.read()
        time.sleep(0.05)
    return process


def untimed(run: Path) -> list[dict[str, Any]]:
    lines = [json.loads(line) for line in (run / "metrics.jsonl").read_text().splitlines()]
    return [{k: v for k, v in one.items() if k not in ("seconds", "waited")} for one in lines]


def test_ctrl_c_keeps_everything_and_resume_goes_on_exactly(episodes: Path, tmp_path: Path) -> None:
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    Train(from_mcap=episodes, out=whole, epochs=30, device="cpu").run()
    process = begun(episodes, parts)
    process.send_signal(signal.SIGINT)
    _, told = process.communicate()
    assert process.returncode == 130, told
    assert "interrupted after" in told
    assert "--resume goes on" in " ".join(told.split())
    assert len(untimed(parts)) < 30
    Train(from_mcap=episodes, out=parts, epochs=30, device="cpu", resume=True).run()
    assert untimed(parts) == untimed(whole)
    assert load(parts).state_dict().keys() == load(whole).state_dict().keys()
    for name, weights in load(parts).state_dict().items():
        assert torch.equal(weights, load(whole).state_dict()[name])


def test_a_killed_training_leaves_a_network_and_begins_again(
    episodes: Path, tmp_path: Path
) -> None:
    process = begun(episodes, tmp_path / "run")
    process.kill()
    process.communicate()
    for name in ("best", "last"):
        assert load(tmp_path / "run" / f"{name}.safetensors").config.points == POINTS
    Train(from_mcap=episodes, out=tmp_path / "run", epochs=30, resume=True).run()
    assert [line["epoch"] for line in untimed(tmp_path / "run")] == list(range(1, 31))


def test_a_finished_training_has_nothing_to_go_on_with(
    run: Path, episodes: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = (run / "best.safetensors").read_bytes()
    Train(from_mcap=episodes, out=run, epochs=3, device="cpu", resume=True).run()
    assert "errors of the best network" in capsys.readouterr().out
    assert (run / "best.safetensors").read_bytes() == before


def test_other_settings_are_not_gone_on_with(run: Path, episodes: Path) -> None:
    with pytest.raises(OtherRun, match="has frames 8, not 4"):
        Train(from_mcap=episodes, out=run, epochs=3, device="cpu", frames=4, resume=True).run()


def test_a_finished_training_goes_on_for_more_epochs(episodes: Path, tmp_path: Path) -> None:
    for epochs in (2, 8):
        Train(from_mcap=episodes, out=tmp_path, epochs=epochs, device="cpu", resume=True).run()
    assert [line["epoch"] for line in untimed(tmp_path)] == list(range(1, 9))
    rates = [line["learning_rate"] for line in untimed(tmp_path)]
    assert rates[2] > rates[1]
    assert read_config(tmp_path)["training"]["epochs"] == 8


def test_a_training_may_begin_with_the_weights_of_another(
    run: Path, episodes: Path, tmp_path: Path
) -> None:
    tune = Train(from_mcap=episodes, out=tmp_path / "tuned", weights=str(run), device="cpu")
    replace(tune, epochs=1, learning_rate=1e-9).run()
    assert read_config(tmp_path / "tuned")["training"]["weights"]
    for name, weights in load(run).state_dict().items():
        torch.testing.assert_close(load(tmp_path / "tuned").state_dict()[name], weights)
    with pytest.raises(OtherRun, match="has weights"):
        replace(tune, epochs=2, learning_rate=1e-9, weights=None, resume=True).run()


def test_the_network_of_hu_leaves_the_same_files_and_is_judged_alike(
    run: Path, episodes: Path, tmp_path: Path
) -> None:
    train = Train(from_mcap=episodes, out=tmp_path / "hu", model="hu", epochs=2, device="cpu")
    train.run()
    assert {path.name for path in train.out.iterdir()} == {path.name for path in run.iterdir()}
    one, other = (json.loads((path / "errors.json").read_text()) for path in (run, train.out))
    pairs = {name: {kind: of and of["pairs"] for kind, of in one[name].items()} for name in one}
    assert pairs == {
        name: {kind: of and of["pairs"] for kind, of in other[name].items()} for name in other
    }
    assert "# HuNet" in (train.out / "MODEL_CARD.md").read_text()
    training = read_config(train.out)["training"]
    kept = training["augmentation"], training["learning_rate"], training["groups"]
    assert kept == (None, 0.01, 4)
    replace(train, out=tmp_path / "again").run()
    best = [(tmp_path / name / "best.safetensors") for name in ("hu", "again")]
    one, other = (load_any(path).state_dict() for path in best)
    assert all(torch.equal(one[name], other[name]) for name in one)
    # What it learned goes with its components, not with those of the frames it is to learn from.
    tuned = replace(train, out=tmp_path / "tuned", weights=str(best[0]), episodes=1)
    replace(tuned, epochs=1, learning_rate=1e-9).run()
    for name, weights in load_any(tuned.out).state_dict().items():
        torch.testing.assert_close(weights, one[name])
    replace(train, epochs=3, resume=True).run()
    assert len(untimed(train.out)) == 3


def test_one_episode_is_enough_and_unseen_shapes_of_it_choose(tmp_path: Path) -> None:
    for index in range(2):
        seen = rollout.frames(12, seed=index, points=POINTS)
        rollout.write(tmp_path / f"episode-{index}.mcap", seen)
    train = Train(
        from_mcap=tmp_path,
        out=tmp_path / "run",
        model="hu",
        episodes=1,
        choose_by="unseen-shapes",
        validation=0.4,
        epochs=6,
        learning_rate=0.02,
        device="cpu",
    )
    train.run()
    lines = untimed(train.out)
    errors = [line["unseen_shapes"]["any_pair"]["mse_mm2"] for line in lines]
    kept = read_metrics(train.out)["unseen_shapes"]["any_pair"]["mse_mm2"]
    assert kept == min(errors)
    assert len(read_config(train.out)["data"]["training"]) == 1
    assert "on unseen shapes" in (train.out / "MODEL_CARD.md").read_text()


def refusals(episodes: Path, tmp_path: Path) -> list[tuple[Train, type[DnetError], str]]:
    good = Train(from_mcap=episodes, out=tmp_path / "run")
    empty = tmp_path / "empty"
    empty.mkdir()
    return [
        (replace(good, from_mcap=tmp_path / "none"), MissingPath, "none does not exist"),
        (replace(good, from_mcap=empty), NoEpisodes, "empty holds no .mcap episode"),
        (replace(good, epochs=0), TooFew, "--epochs is 0, must be at least 1e-09"),
        (replace(good, workers=-1), TooFew, "--workers is -1, must be at least 0"),
        (
            replace(good, learning_rate=0.0),
            TooFew,
            "--learning-rate is 0.0, must be at least 1e-09",
        ),
        (replace(good, groups=0), TooFew, "number of groups in a batch is 0"),
        (replace(good, seed=-1), TooFew, "--seed is -1, must be at least 0"),
        (replace(good, minutes=0.0), TooShort, "--minutes is 0.0, must be above 0"),
        (replace(good, validation=2.0), NotAFraction, "validation fraction is 2.0"),
        (replace(good, weights="nowhere"), BadCheckpoint, "nowhere does not exist"),
        (replace(good, weights="shipped", norm="batch"), BadCheckpoint, "with norm group, not"),
        (
            replace(good, model="hu", relu=False, weights="shipped"),
            BadCheckpoint,
            "hu.safetensors is of a network with relu True, not False",
        ),
        (replace(good, episodes=0), TooFew, "--episodes is 0, must be at least 1"),
        (replace(good, relu=False), UnusedOption, "--no-relu does nothing without --model hu"),
        (replace(good, model="hu", norm="batch"), UnusedOption, "without another --model"),
        (replace(good, size="paper"), TooFew, "136, must be at least 512"),
    ]


def test_what_makes_no_sense_is_refused_and_leaves_no_run(episodes: Path, tmp_path: Path) -> None:
    for command, error, complaint in refusals(episodes, tmp_path):
        with pytest.raises(error, match=complaint):
            command.run()
        assert not command.out.exists()


def test_a_gpu_that_is_not_there_is_refused(episodes: Path, tmp_path: Path) -> None:
    if torch.cuda.is_available():
        assert Train(from_mcap=episodes, out=tmp_path, device="cuda").device == "cuda"
        return
    with pytest.raises(NoDevice, match="use --device cpu"):
        Train(from_mcap=episodes, out=tmp_path / "run", device="cuda").run()


def test_a_directory_that_holds_a_run_is_left_alone(run: Path, episodes: Path) -> None:
    before = {path.name: path.read_bytes() for path in run.iterdir()}
    with pytest.raises(OccupiedOutput, match="already holds a run"):
        Train(from_mcap=episodes, out=run).run()
    assert {path.name: path.read_bytes() for path in run.iterdir()} == before


def test_episodes_of_different_point_counts_are_refused(tmp_path: Path) -> None:
    for index, points in enumerate((POINTS, POINTS + 1)):
        seen = rollout.frames(3, seed=index, points=points)
        rollout.write(tmp_path / f"episode-{index}.mcap", seen)
    with pytest.raises(BadEpisode, match="one number of points"):
        Train(from_mcap=tmp_path, out=tmp_path / "run").run()


def test_the_command_line_is_read_without_loading_torch() -> None:
    code = "import sys, dnet.commands.train; sys.exit('torch' in sys.modules)"
    began = time.monotonic()
    subprocess.run([sys.executable, "-c", code], check=True)
    assert time.monotonic() - began < 30
