"""An exported network predicts, and refuses, as the original does."""

from typing import Any

import numpy as np
import pytest

from dnet.errors import BadCloud, ShortCloud
from dnet.nets.onnx_agreement import LIMIT
from dnet.nets.onnx_graph import as_graph
from dnet.nets.onnx_network import OnnxDeformerNet, open_session
from tests.nets.test_deformernet import clouds
from tests.nets.test_onnx_graph import made

MODEL = made()
SESSION = open_session(as_graph(MODEL, metadata={}).SerializeToString())


def exported() -> OnnxDeformerNet:
    return OnnxDeformerNet(SESSION, MODEL.config)


class Counted:
    """A session that counts its runs."""

    def __init__(self) -> None:
        self.runs = 0

    def run(self, *call: Any) -> Any:
        self.runs += 1
        return SESSION.run(*call)


@pytest.mark.parametrize("points", [192, 500])
def test_it_predicts_what_the_original_does_of_a_larger_cloud_too(points: int) -> None:
    current, goal = clouds(2, points)
    motion, want = exported().predict(current, goal), MODEL.predict(current, goal)
    assert motion.dtype == np.float64
    np.testing.assert_allclose(motion, want, rtol=0, atol=LIMIT * np.abs(want).max())


def test_a_goal_is_encoded_once_until_it_changes() -> None:
    current, other, goal = clouds(3)
    session = Counted()
    model = OnnxDeformerNet(session, MODEL.config)
    first = model.predict(current, goal)
    model.predict(other, goal.copy())
    assert session.runs == 3
    np.testing.assert_array_equal(model.predict(current, goal), first)
    goal[3] += 0.01
    assert not np.array_equal(model.predict(current, goal), first)
    assert session.runs == 6


def test_bad_clouds_are_refused() -> None:
    current, goal = clouds(2)
    with pytest.raises(ShortCloud, match="191 points, need at least 192"):
        exported().predict(current[:-1], goal)
    goal[2, 1] = np.nan
    with pytest.raises(BadCloud, match="goal cloud has 1 of 192 points with NaN"):
        exported().predict(current, goal)
