"""What methods know before a run begins."""

import numpy as np
import pytest

from dnet.laboratory import LaboratorySettings, laboratory
from dnet.nets.deformernet import DeformerNet
from dnet.trials.goals import read_task
from dnet.trials.methods import CONTROLLERS, Setting
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
