from pathlib import Path

import pytest

from dnet.evaluation.report.asked import Asked, read_asked, write_asked
from dnet.evaluation.report.runs import read_runs, scores_of, within
from dnet.evaluation.servo_scores import Score

NAN = float("nan")


def score(last: float) -> Score:
    return Score(
        "g", "converged", 2, 0.011, last, 0.001, 0.5, 9 * last, 0.04, 0.02, 0.003, 0.0, 40.0
    )


def test_runs_of_whose_end_nothing_is_known_count_as_failed() -> None:
    some = [score(0.001), score(0.004), score(NAN)]
    assert within(some, 0.002) == pytest.approx(1 / 3)
    assert within(some, 0.004) == pytest.approx(2 / 3)
    assert within(some, 1.0) == pytest.approx(2 / 3)
    assert within(some, 0.01, legacy=True) == pytest.approx(1 / 3)


def test_refused_runs_are_read_and_missing_ones_are_none(tmp_path: Path) -> None:
    refused = tmp_path / "none" / "a"
    refused.mkdir(parents=True)
    (refused / "refused.json").write_text('{"error": "out of reach"}')
    asked = Asked(2, 100, 0, 0.02, {}, {}, {}, runs={"none": ("none/a", "none/b")})
    write_asked(tmp_path, asked)
    assert read_asked(tmp_path) == asked
    runs = read_runs(tmp_path, asked)["none"]
    assert [run.score is None for run in runs] == [False, True]
    assert [one.outcome for one in scores_of(runs)] == ["refused"]
