import json
from pathlib import Path

import pytest

from dnet.errors import BadReport
from dnet.evaluation.report.asked import Asked
from dnet.evaluation.report.networks_section import networks_section
from dnet.evaluation.report.values import Section

ASKED = Asked(1500, 1500, 0, 1.0, {}, {}, {})


def training(
    folder: Path, model: str, mse: float, *, episodes: int | None = None, points: int = 2048
) -> None:
    scores = {
        "pairs": 9,
        "mse_mm2": mse,
        "sum_mm2": 3 * mse,
        "mean_mm": mse**0.5,
        "zero_mse_mm2": 1000.0,
    }
    errors = {
        part: {"any_pair": scores, "from_rest": None} for part in ("training", "unseen shapes")
    }
    config = {"network": {"model": model, "points": points}, "training": {"episodes": episodes}}
    folder.mkdir(parents=True)
    (folder / "errors.json").write_text(json.dumps(errors))
    (folder / "config.json").write_text(json.dumps(config))


def section(folder: Path) -> Section:
    (folder / "architecture.json").write_text('{"paper": 5, "shipped": 4}')
    return networks_section(folder, ASKED, title="networks", out=folder)


def test_each_error_is_held_against_the_papers_in_its_own_reduction(tmp_path: Path) -> None:
    training(tmp_path / "own", "deformernet", 1.0)
    train, test = section(tmp_path).claims[1:3]
    assert (train.ours, train.met) == ("1.00 mm²", True)  # a mean, against 1.5
    assert (test.ours, test.met) == ("3.00 mm²", False)  # a sum, against 2.4


def test_a_baseline_is_met_if_it_is_as_far_behind(tmp_path: Path) -> None:
    training(tmp_path / "own", "deformernet", 2.0)
    training(tmp_path / "hu", "hu", 60.0)
    claims = section(tmp_path).claims
    assert [claim.met for claim in claims[3:5]] == [True, False]  # 27 and 52 times
    assert "30 times" in claims[3].reason


def test_few_shapes_are_no_full_dataset(tmp_path: Path) -> None:
    training(tmp_path / "few", "hu", 10.0, episodes=1)
    claims = section(tmp_path).claims
    assert [claim.met for claim in claims[1:]] == [None] * 5
    training(tmp_path / "hu", "hu", 60.0)
    assert section(tmp_path).claims[-1].met is True


def test_a_network_for_sparser_clouds_is_not_held_against_the_paper(tmp_path: Path) -> None:
    training(tmp_path / "sparser", "deformernet", 1.0, points=512)
    assert section(tmp_path).claims[1].ours == "1.00 mm²", "unless there is no other"
    training(tmp_path / "own", "deformernet", 1.2)
    assert section(tmp_path).claims[1].ours == "1.20 mm²"


def test_what_is_no_training_is_refused_by_name(tmp_path: Path) -> None:
    training(tmp_path / "own", "deformernet", 1.0)
    (tmp_path / "own" / "errors.json").write_text("{")
    with pytest.raises(BadReport, match="own is no finished training"):
        section(tmp_path)
