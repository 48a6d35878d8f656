import json
from pathlib import Path

import pytest

from dnet.commands.evaluate import Ablations, Evaluate, Network
from dnet.commands.train import Train
from dnet.errors import UnknownAblation
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
