import json
from dataclasses import replace
from pathlib import Path

import pytest

from dnet.commands.evaluate import Ablations, Evaluate, Network
from dnet.commands.evaluate_grasp import Grasp
from dnet.commands.train import Train
from dnet.errors import BadCheckpoint, UnknownAblation, UnusedOption
from tests.training.deforming_box import BoxEpisode, write_boxes


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    boxes = [BoxEpisode(seed, ("rest", *("shape",) * 7)) for seed in range(4)]
    return write_boxes(tmp_path_factory.mktemp("data"), boxes)


def test_ablations_end_as_a_table_and_are_not_made_again(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    only = ("as by default", "from rest, single pairs")
    command = Ablations(data, tmp_path, encodings=64, only=only, validation=0.3)
    Evaluate(command).run()
    table = (tmp_path / "ablations.md").read_text()
    assert [line.split(" | ")[0] for line in table.splitlines()[2:]] == [
        f"| {name}" for name in only
    ]
    config = json.loads((tmp_path / "from-rest-single-pairs" / "config.json").read_text())
    assert config["training"]["pairs"] == "rest"
    rows = [line.split(" | ") for line in table.splitlines()[2:]]
    # To a batch.
    assert all(64 <= int(row[1]) < 64 + 18 for row in rows)
    made = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.safetensors")}
    Evaluate(command).run()
    assert (tmp_path / "ablations.md").read_text() == table
    assert {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*.safetensors")} == made
    assert "as by default" in capsys.readouterr().out


def test_an_ablation_that_there_is_not_is_refused(data: Path, tmp_path: Path) -> None:
    with pytest.raises(UnknownAblation, match="no ablation 'nothing'; there are as by default, "):
        Ablations(data, tmp_path / "out", only=("nothing",)).run()
    assert not (tmp_path / "out").exists()


def test_a_network_is_judged_on_all_pairs_of_any_dataset(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Train(data, tmp_path / "run", epochs=1, device="cpu").run()
    other = write_boxes(tmp_path / "other", [BoxEpisode(9)])
    capsys.readouterr()
    Evaluate(Network(other, tmp_path / "run", json=True)).run()
    errors = json.loads(capsys.readouterr().out)
    assert errors["any_pair"]["pairs"] == 30
    assert errors["from_rest"]["pairs"] == 5
    Evaluate(Network(other, tmp_path / "run")).run()
    assert f"{errors['any_pair']['mse_mm2']:.2f}" in capsys.readouterr().out


def test_a_network_is_judged_apart_on_what_its_training_held_out(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Train(data, tmp_path / "run", epochs=1, device="cpu", validation=0.3).run()
    trained = json.loads((tmp_path / "run" / "errors.json").read_text())
    capsys.readouterr()
    Evaluate(Network(data, tmp_path / "run", validation=0.3, json=True)).run()
    judged = json.loads(capsys.readouterr().out)
    assert list(judged) == ["training", "unseen shapes", "unseen episodes"]
    for name, errors in judged.items():
        assert errors["any_pair"] == pytest.approx(trained[name]["any_pair"])


def test_methods_of_grasping_are_trained_and_compared_with_the_truth(
    data: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Train(data, tmp_path / "keypoints", model="keypoints", epochs=2, device="cpu").run()
    capsys.readouterr()
    for model in ("grasp", "dense"):
        Train(data, tmp_path / model, model=model, epochs=2, device="cpu", validation=0.3).run()
        card = (tmp_path / model / "MODEL_CARD.md").read_text()
        assert "rest to shape" in card
        assert "any two" not in card
        assert "the middle" in capsys.readouterr().out
        assert (tmp_path / model / "training.rrd").exists()
        Evaluate(Network(data, tmp_path / model, json=True)).run()
        assert json.loads(capsys.readouterr().out)["from_rest"]["pairs"] == 28
    out = tmp_path / "grasp-report"
    report = Grasp(
        data,
        out,
        cases=6,
        validation=1.0,
        keypoints=tmp_path / "keypoints",
        regressor=tmp_path / "grasp",
        dense=tmp_path / "dense",
    )
    Evaluate(report).run()
    table = (out / "grasp.md").read_text()
    methods = ("random point", "most displaced point", "keypoints", "regressor", "dense")
    assert [line.split(" | ")[0] for line in table.splitlines()[2:]] == [f"| {m}" for m in methods]
    assert len((out / "grasp.csv").read_text().splitlines()) == 1 + 6 * 5
    assert {path.name for path in out.iterdir()} == {
        "grasp.md",
        "grasp.csv",
        "grasp.png",
        "grasp.rrd",
    }
    assert "random point" in capsys.readouterr().out
    with pytest.raises(BadCheckpoint, match="holds PointRegressor, not DensePredictor"):
        replace(report, dense=tmp_path / "grasp").run()


def test_pairs_other_than_from_rest_are_no_way_to_learn_where_to_grasp(
    data: Path, tmp_path: Path
) -> None:
    with pytest.raises(UnusedOption, match="--pairs any does nothing without --model deformernet"):
        Train(data, tmp_path / "run", model="dense", pairs="any").run()
