import json
from dataclasses import fields
from pathlib import Path

import pytest

from dnet.commands.train import Train
from dnet.errors import BadCheckpoint
from dnet.evaluation.ablations import ABLATIONS, read_ablation, table_of


def write_run(run: Path) -> Path:
    run.mkdir()
    errors = {
        name: {
            pairs: {"mse_mm2": base + shift} for pairs, shift in (("any_pair", 0), ("from_rest", 1))
        }
        for name, base in (("unseen shapes", 2.0), ("unseen episodes", 4.0))
    }
    (run / "errors.json").write_text(json.dumps(errors))
    (run / "metrics.jsonl").write_text('{"encodings": 240}\n{"encodings": 1680}\n')
    return run


def test_every_ablation_changes_options_that_training_has() -> None:
    options = {field.name for field in fields(Train)}
    plain = Train(Path("data"), Path("run"))
    for name, changed in ABLATIONS.items():
        assert set(changed) <= options
        for option, value in changed.items():
            assert getattr(plain, option) != value, name
    assert ABLATIONS["as by default"] == {}
    assert len({str(changed) for changed in ABLATIONS.values()}) == len(ABLATIONS)


def test_a_row_tells_what_a_run_came_to(tmp_path: Path) -> None:
    found = read_ablation("one", write_run(tmp_path / "run"))
    assert found.encodings == 1680
    assert found.cells == ("one", "1,680", "2.0", "3.0", "4.0", "5.0")
    lines = table_of([found, found]).splitlines()
    assert len(lines) == 4
    assert lines[2] == lines[3] == "| one | 1,680 | 2.0 | 3.0 | 4.0 | 5.0 |"
    assert {line.count("|") for line in lines} == {7}


@pytest.mark.parametrize("name", ["errors.json", "metrics.jsonl"])
@pytest.mark.parametrize("content", [None, "", "{", "[]"])
def test_a_run_that_is_not_finished_is_named(
    tmp_path: Path, name: str, content: str | None
) -> None:
    run = write_run(tmp_path / "run")
    (run / name).unlink()
    if content is not None:
        (run / name).write_text(content)
    with pytest.raises(BadCheckpoint, match="is not a finished training"):
        read_ablation("one", run)
