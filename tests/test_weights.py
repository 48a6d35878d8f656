"""The networks that ship: whole, small, with a card, and good on what they have never seen."""

import json
import re
from pathlib import Path

import pytest

import dnet
from dnet.commands.evaluate import Evaluate, Network
from dnet.commands.evaluate_grasp import Grasp
from dnet.commands.record import Record
from dnet.errors import BadCheckpoint
from dnet.training.checkpoints import read_metrics
from dnet.weights import DEFORMERNET, DENSE, HU, KEYPOINTS, REGRESSOR


def test_it_is_small_enough_to_ship_and_loads_without_a_path() -> None:
    assert DEFORMERNET.stat().st_size < 8_000_000
    network = dnet.load()
    assert network.config.points == 2048
    assert not network.training


@pytest.mark.parametrize("weights", [DEFORMERNET, HU])
def test_its_card_tells_the_same_epoch_as_its_file(weights: Path) -> None:
    text = weights.with_suffix(".md").read_text(encoding="utf-8")
    metrics = read_metrics(weights)
    assert f"**Best epoch**: {metrics['epoch']} of " in text
    rows = [line for line in text.splitlines() if line.startswith("| unseen")]
    assert len(rows) == 4
    # Judged on all frames; the file tells the errors on some of them.
    told = float(rows[2].split("|")[4])
    found = metrics["unseen_episodes"]["any_pair"]["mse_mm2"]
    assert re.match(r"\| unseen episodes \| any two", rows[2])
    assert told == pytest.approx(found, rel=0.2)


def test_it_predicts_the_motions_of_an_episode_that_it_has_never_seen(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of the other world, too: its shapes are those of the same energy. So does Hu's, but worse."""
    Record(tmp_path / "data", pairs=1, shapes=8, seed=977, world="quasistatic").run()
    found = []
    for weights in (None, HU):
        capsys.readouterr()
        Evaluate(Network(tmp_path / "data", checkpoint=weights, json=True)).run()
        errors = json.loads(capsys.readouterr().out)["any_pair"]
        assert errors["pairs"] == 72
        found.append(errors["mse_mm2"])
    deformernet, hu = found
    assert deformernet < errors["zero_mse_mm2"] / 30
    assert 20 * deformernet < hu < errors["zero_mse_mm2"]


@pytest.mark.parametrize("weights", [REGRESSOR, DENSE, KEYPOINTS])
def test_networks_that_choose_a_grasp_are_small_and_have_cards_of_the_same_epoch(
    weights: Path,
) -> None:
    assert weights.stat().st_size < 8_000_000
    metrics = read_metrics(weights)
    text = weights.with_suffix(".md").read_text(encoding="utf-8")
    assert f"**Best epoch**: {metrics['epoch']} of " in text
    (row,) = [line for line in text.splitlines() if line.startswith("| unseen episodes | rest")]
    told = float(row.split("|")[6])
    found = metrics["unseen_episodes"]["from_rest"]["mean_mm"]
    assert told == pytest.approx(found, rel=0.1)


def test_grasps_are_chosen_nearer_to_the_truth_than_without_learning(tmp_path: Path) -> None:
    Record(tmp_path / "data", pairs=4, shapes=5, seed=977, world="quasistatic").run()
    Evaluate(Grasp(tmp_path / "data", tmp_path / "out", cases=20, validation=1.0)).run()
    rows = [
        [cell.strip() for cell in line.split("|")[1:]]
        for line in (tmp_path / "out" / "grasp.md").read_text().splitlines()[2:]
    ]
    means = {row[0]: float(row[2]) for row in rows}
    for method, share in (("keypoints", 0.7), ("regressor", 0.6), ("dense", 0.6)):
        assert means[method] < means["most displaced point"]
        assert means[method] < share * means["random point"]


def test_what_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(BadCheckpoint, match="does not exist; give a run directory"):
        dnet.load(tmp_path / "none")
