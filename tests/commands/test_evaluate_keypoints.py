import re
from pathlib import Path

import pytest

from dnet.commands.evaluate import Evaluate
from dnet.commands.evaluate_keypoints import EvaluateKeypoints
from dnet.nets.keypoints import KeypointNet
from dnet.training.checkpoints import save
from tests.training.deforming_box import SMALL, BoxEpisode, write_boxes


def test_keypoints_are_judged_beside_what_learns_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = write_boxes(tmp_path / "data", [BoxEpisode(seed) for seed in range(4)])
    path = tmp_path / "keypoints.safetensors"
    save(path, KeypointNet(SMALL))
    command = EvaluateKeypoints(data, path, cases=6, validation=0.5)
    tables = []
    for _ in range(2):
        Evaluate(command).run()
        tables.append(capsys.readouterr().out)
    for name in ("unmoved", "rigid", "learned"):
        assert name in tables[0]
    assert "6 cases from" in tables[0]
    # All but the time, in the last column, comes out the same.
    one, other = (re.sub(r"\d+ ms", "", table) for table in tables)
    assert one.split() == other.split()
