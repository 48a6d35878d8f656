from pathlib import Path

import pytest

from dnet.commands.evaluate import Evaluate
from dnet.commands.evaluate_importance import Importance
from dnet.commands.servo import ServoOptions
from dnet.datasets.reader import EpisodeReader


def test_a_bad_grasp_ends_farther_from_the_goal_than_a_good_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ServoOptions(world="quasistatic", steps=2)
    command = Importance("random:7", tmp_path / "both", controller="oracle", options=options)
    Evaluate(command).run()
    lines = (tmp_path / "both" / "importance.md").read_text().splitlines()
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]
    assert [row[0] for row in cells] == ["good (truth)", "bad (farthest)"]
    good, bad = (float(row[4]) for row in cells)
    assert good < 1.0 < bad
    said = capsys.readouterr().out
    assert "dnet play" in said
    for which in ("good", "bad"):
        with EpisodeReader(tmp_path / "both" / which / "run.mcap") as run:
            assert run.result is not None
        assert (tmp_path / "both" / which / "run.rrd").exists()
