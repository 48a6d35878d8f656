"""A choice becomes points of the surface, the best first, those tried before left out."""

import numpy as np

from dnet.servo.pickers import APART, Choice, TruePoint, candidates

CLOUD = np.random.default_rng(0).uniform(-0.05, 0.05, (200, 3)).astype(np.float32)
POINT = np.array([0.01, 0.02, 0.03])


def test_the_true_point_is_what_it_was_told() -> None:
    choice = TruePoint(POINT).pick(CLOUD, CLOUD)
    np.testing.assert_array_equal(choice.point, POINT)
    assert choice.confidence == 1.0


def test_the_chosen_point_comes_first_and_then_the_surface_near_it() -> None:
    ranked = candidates(Choice(POINT, 1.0), CLOUD, [])
    np.testing.assert_array_equal(ranked[0], POINT)
    distances = np.linalg.norm(ranked[1:] - POINT, axis=1)
    assert len(distances) == len(CLOUD)
    assert np.all(np.diff(distances) >= 0)


def test_scores_decide_where_there_are_some() -> None:
    scores = np.random.default_rng(1).random(len(CLOUD))
    ranked = candidates(Choice(POINT, 0.5, scores), CLOUD, [])
    np.testing.assert_array_equal(ranked[1], CLOUD[scores.argmax()].astype(float))
    np.testing.assert_array_equal(ranked[-1], CLOUD[scores.argmin()].astype(float))


def test_what_was_tried_is_not_tried_again() -> None:
    tried = [POINT, CLOUD[7].astype(float)]
    ranked = candidates(Choice(POINT, 1.0), CLOUD, tried)
    for point in tried:
        assert np.linalg.norm(ranked - point, axis=1).min() > APART
