"""What is told of two networks is how far they are apart."""

import copy

import numpy as np
import torch

from dnet.nets.onnx_agreement import (
    LIMIT,
    Agreement,
    agreement,
    random_clouds,
    seconds_a_prediction,
)
from tests.nets.test_onnx_network import MODEL, exported


def test_a_network_agrees_with_what_was_made_of_it_and_with_nothing_else() -> None:
    found = agreement(MODEL, exported())
    assert 0 < found.worst <= LIMIT
    assert found.pairs == 12
    other = copy.deepcopy(MODEL)
    with torch.no_grad():
        other.head.output.bias.add_(1e-3)
    changed = agreement(other, exported())
    assert changed.features == found.features
    assert changed.motion > LIMIT


def test_what_is_no_number_agrees_with_nothing() -> None:
    assert np.isnan(Agreement(np.nan, 0.0, 1).worst)
    assert np.isnan(Agreement(0.0, np.nan, 1).worst)


def test_the_clouds_are_the_same_at_every_call_and_differ_from_each_other() -> None:
    one, other = random_clouds(2, 50)
    assert one.shape == (50, 3)
    np.testing.assert_array_equal(random_clouds(2, 50)[1], other)
    assert not np.array_equal(one, other)


def test_a_prediction_takes_time() -> None:
    assert seconds_a_prediction(MODEL) > 0
