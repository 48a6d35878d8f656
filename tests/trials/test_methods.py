"""What methods know before a run begins."""

from pathlib import Path

import numpy as np
import pytest

from dnet.laboratory import LaboratorySettings, laboratory
from dnet.nets.deformernet import DeformerNet, DeformerNetConfig
from dnet.training.checkpoints import save
from dnet.trials.goals import read_task
from dnet.trials.methods import CONTROLLERS, Setting, points_of
from dnet.trials.request import Trial
from dnet.types import Cloud


def test_no_step_waits_for_the_goal_to_be_encoded(
    monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory
) -> None:
    settings = LaboratorySettings(world="quasistatic")
    asked = Trial("random:3", tmp_path_factory.mktemp("out"), laboratory=settings)
    encoded: list[str] = []
    encode = DeformerNet._features

    def noted(self: DeformerNet, cloud: Cloud, what: str, *, about: Cloud) -> object:
        encoded.append(what)
        return encode(self, cloud, what, about=about)

    monkeypatch.setattr(DeformerNet, "_features", noted)
    with laboratory(settings) as lab:
        task = read_task(asked, lab)
        controller = CONTROLLERS["deformernet"](Setting(asked, task, lab))
    assert "goal cloud" in encoded
    encoded.clear()
    controller.predict(task.goal.cloud + np.float32(0.001), task.goal.cloud)
    assert encoded == ["current cloud"]


def test_a_network_that_was_trained_anew_is_not_the_one_that_lay_there_before(
    tmp_path: Path,
) -> None:
    path = tmp_path / "best.safetensors"
    for points in (512, 1024):
        save(path, DeformerNet(DeformerNetConfig(points=points)))
        assert points_of("deformernet", tmp_path) == points
        assert points_of("deformernet", tmp_path) == points


def test_the_network_that_ships_is_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    points_of("deformernet", None)

    def read(*_: object) -> None:
        raise AssertionError("read again")

    monkeypatch.setattr("dnet.training.checkpoints.load", read)
    assert points_of("deformernet", None) == 2048
