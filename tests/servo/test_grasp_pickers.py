from dataclasses import dataclass

import numpy as np
import pytest
from jaxtyping import Float32

from dnet.errors import NoDisplacement
from dnet.nets.manipulation_point import Chosen
from dnet.servo.grasp_pickers import MostDisplaced, NetworkPicker, RandomPoint
from dnet.servo.pickers import Picker
from dnet.types import Cloud, Point

GRID = np.stack(np.meshgrid(*2 * [np.linspace(-0.05, 0.05, 40)]), axis=-1).reshape(-1, 2)
FLAT = np.concatenate([GRID, np.zeros((1600, 1))], axis=1).astype(np.float32)
TOP = np.array([0.02, -0.01])


def bump() -> Cloud:
    """The sheet, pulled up at one point."""
    pulled = FLAT.copy()
    pulled[:, 2] = 0.04 * np.exp(-((np.linalg.norm(GRID - TOP, axis=1) / 0.02) ** 2))
    return pulled


@dataclass
class Said:
    point: Point
    probabilities: Float32[np.ndarray, " n"] | None = None

    def choose(self, initial: Cloud, goal: Cloud) -> Chosen:
        if self.probabilities is None:
            return Chosen(self.point)
        return Chosen(self.point, initial, self.probabilities)


def test_a_choice_off_the_surface_is_brought_to_it_and_trusted_less() -> None:
    near, far = (
        NetworkPicker(Said(np.array([0.013, 0.007, height]))).pick(FLAT, bump())
        for height in (0.002, 0.03)
    )
    np.testing.assert_array_equal(near.point, far.point)
    assert np.linalg.norm(near.point - [0.013, 0.007, 0]) < 0.002
    assert near.confidence > 0.7
    assert far.confidence < 0.1


def test_probability_about_the_choice_is_the_confidence() -> None:
    here = np.linalg.norm(FLAT - FLAT[800], axis=1) < 0.01
    sure = (here / here.sum()).astype(np.float32)
    even = np.full(len(FLAT), 1 / len(FLAT), np.float32)
    picks = [
        NetworkPicker(Said(FLAT[800].astype(np.float64), scores)).pick(FLAT, bump())
        for scores in (sure, even)
    ]
    assert picks[0].confidence == pytest.approx(1, abs=1e-5)
    assert picks[1].confidence < 0.2
    np.testing.assert_array_equal(picks[1].scores, even)


def test_the_most_displaced_point_is_the_top_of_the_bump() -> None:
    choice = MostDisplaced().pick(FLAT, bump())
    assert np.linalg.norm(choice.point[:2] - TOP) < 0.01


def test_a_random_point_is_of_the_cloud_and_a_function_of_the_seed() -> None:
    one, again, other = (RandomPoint(seed).pick(FLAT, bump()).point for seed in (0, 0, 1))
    np.testing.assert_array_equal(one, again)
    assert (one != other).any()
    assert (np.abs(FLAT - one).max(axis=1) == 0).any()


@pytest.mark.parametrize("picker", [MostDisplaced(), NetworkPicker(Said(np.zeros(3)))])
def test_the_initial_shape_as_a_goal_is_refused(picker: Picker) -> None:
    jittered = (FLAT + np.random.default_rng(0).normal(0, 5e-4, FLAT.shape)).astype(np.float32)
    with pytest.raises(
        NoDisplacement, match=r"0\.\d mm from the initial shape, need at least 1\.3"
    ):
        picker.pick(FLAT, jittered)
