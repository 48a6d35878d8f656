import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dnet.errors import NoDisplacement, OutOfReach
from dnet.geometry.sampling import farthest_points
from dnet.nets.keypoints import Keypoints
from dnet.servo.displacement_heuristic import (
    FAINT,
    DisplacementHeuristic,
    most_of,
    pulls,
    with_hidden,
)
from dnet.sim.scenes import Workspace
from dnet.types import Cloud

CENTRE = np.array([0.02, 0.01, 0.04])


def slab() -> Cloud:
    """The upper side of a box at rest, seen from above."""
    x, y = np.meshgrid(np.linspace(-0.05, 0.05, 41), np.linspace(-0.05, 0.05, 41))
    return np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 0.04)]).astype(np.float32)


def bumped(points: Cloud, height: float = 0.03) -> Cloud:
    """The same, pulled up at one point."""
    away = np.linalg.norm(points[:, :2] - CENTRE[:2], axis=1)
    lift = height * np.exp(-((away / 0.03) ** 2))
    return (points + lift[:, None] * np.array([0.0, 0.0, 1.0])).astype(np.float32)


def true_keypoints(initial: Cloud, goal: Cloud) -> Keypoints:
    """What a perfect network would find of the bump."""
    points = farthest_points(initial, 200)
    return Keypoints(points, bumped(points), 0.0)


def unmoved(initial: Cloud, goal: Cloud) -> Keypoints:
    return Keypoints(initial[:200], initial[:200], 0.0)


@pytest.mark.parametrize(("most", "power"), [(3, 1), (10, 1), (20, 1), (20, 4), (200, 4)])
def test_the_point_that_was_pulled_is_found(most: int, power: int) -> None:
    found = DisplacementHeuristic(true_keypoints, most, power).choose(slab(), bumped(slab()))
    assert np.linalg.norm(found.point - CENTRE) < 0.005
    assert found.confidence == 1.0


def test_a_choice_tells_what_it_was_made_by() -> None:
    found = DisplacementHeuristic(true_keypoints, 10).choose(slab(), bumped(slab()))
    moved = np.linalg.norm(found.keypoints.goal - found.keypoints.initial, axis=1)
    np.testing.assert_allclose(found.displacement, moved)
    assert np.count_nonzero(found.weights) == 10
    assert moved[found.weights.argmax()] > 0.95 * moved.max()
    assert found.weights.sum() == pytest.approx(1.0, abs=1e-6)


def test_the_point_lies_on_the_surface_within_reach() -> None:
    cloud = slab()
    far = DisplacementHeuristic(true_keypoints, 3, workspace=Workspace(clearance=0.09))
    found = far.choose(cloud, bumped(cloud))
    assert found.point[0] >= cloud[:, 0].min() + 0.09 - 1e-6
    assert found.point.astype(np.float32).tolist() in cloud.tolist()


def test_without_displacement_there_is_no_answer() -> None:
    with pytest.raises(
        NoDisplacement, match=r"is 0\.0 mm from the initial shape, need at least 3\.0 mm"
    ):
        DisplacementHeuristic(unmoved).choose(slab(), slab())


def test_an_object_out_of_reach_is_refused() -> None:
    heuristic = DisplacementHeuristic(true_keypoints, workspace=Workspace(clearance=0.2))
    with pytest.raises(OutOfReach, match="none of 1681 points"):
        heuristic.choose(slab(), bumped(slab()))


def test_confidence_is_the_share_of_the_difference_that_is_explained() -> None:
    initial, goal = slab(), bumped(slab())

    def nothing_explained(initial: Cloud, goal: Cloud) -> Keypoints:
        found = true_keypoints(initial, goal)
        return Keypoints(found.initial, found.goal, 1.0)

    assert DisplacementHeuristic(nothing_explained).choose(initial, goal).confidence == 0.0


def lever(points: Cloud) -> Cloud:
    """A strip that is held at least x and pulled up at its middle: beyond, all moves alike."""
    lift = 0.04 * np.clip((points[:, :1] + 0.05) / 0.06, 0.0, 1.0)
    return (points + lift * [0.0, 0.0, 1.0]).astype(np.float32)


@pytest.mark.parametrize("seed", range(4))
def test_what_lies_beyond_the_grasp_and_moves_as_far_is_not_taken(seed: int) -> None:
    noise = np.random.default_rng(seed).normal(0.0, 2e-4, (200, 3))

    def found_nearly(initial: Cloud, goal: Cloud) -> Keypoints:
        points = farthest_points(initial, 200)
        return Keypoints(points, (lever(points) + noise).astype(np.float32), 0.0)

    strip = slab()[np.abs(slab()[:, 1]) < 0.02]
    found = DisplacementHeuristic(found_nearly).choose(strip, lever(strip))
    assert found.point[0] == pytest.approx(0.01, abs=0.012)
    farthest = DisplacementHeuristic(found_nearly, power=0).choose(strip, lever(strip))
    assert farthest.point[0] > 0.02


def test_a_point_is_pulled_by_what_it_has_beyond_the_mean_around_it() -> None:
    points = farthest_points(slab(), 200)
    bump = pulls(Keypoints(points, bumped(points), 0.0))
    away = np.linalg.norm(points - CENTRE.astype(np.float32), axis=1)
    assert away[bump.argmax()] < 0.01
    assert bump.max() > 0.005
    # Along its own displacement: what moves less than its surroundings is not pulled.
    lift = bumped(points) - points
    dent = pulls(Keypoints(points, points + np.array([0.0, 0.0, 0.06], np.float32) - lift, 0.0))
    assert dent[away < 0.01].max() < 1e-4


def test_where_all_moves_alike_nothing_is_pulled_but_faintly() -> None:
    points = farthest_points(slab(), 200)
    shift = np.array([0.01, 0.0, 0.02], np.float32)
    alike = pulls(Keypoints(points, points + shift, 0.0))
    np.testing.assert_allclose(alike, FAINT * np.linalg.norm(shift), rtol=1e-3)


@given(
    values=st.lists(st.floats(2**-10, 1.0, width=32), min_size=3, max_size=30),
    most=st.integers(1, 40),
)
def test_the_greatest_weights_are_kept_in_proportion(values: list[float], most: int) -> None:
    before = np.array(values, np.float32)
    weights = most_of(before, most)
    assert weights.sum() == pytest.approx(1.0, abs=1e-5)
    counted = np.flatnonzero(weights)
    assert len(counted) == min(most, len(values))
    others = np.setdiff1d(np.arange(len(values)), counted)
    assert before[others].max(initial=0) <= before[counted].min()
    ratio = weights[counted] / before[counted]
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-4)


def box_top_and_front() -> Cloud:
    """What a camera at -y sees of a box on a table: not the side at +x."""
    x, y = np.meshgrid(np.linspace(-0.05, 0.05, 41), np.linspace(-0.05, 0.05, 41))
    top = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, 0.04)])
    x, z = np.meshgrid(np.linspace(-0.05, 0.05, 41), np.linspace(0.0, 0.04, 17))
    front = np.column_stack([x.ravel(), np.full(x.size, -0.05), z.ravel()])
    return np.concatenate([top, front]).astype(np.float32)


def test_where_motion_grows_towards_a_side_that_is_not_seen_that_is_grasped() -> None:
    def pulled(points: Cloud) -> Cloud:
        far = 0.3 * (points[:, 0] + 0.05) - 0.3 * points[:, 2] + 0.02
        return (points + far[:, None] * [1.0, 0.0, 0.0]).astype(np.float32)

    def found_among_the_seen(initial: Cloud, goal: Cloud) -> Keypoints:
        points = farthest_points(initial, 200)
        return Keypoints(points, pulled(points), 0.0)

    cloud = box_top_and_front()
    found = DisplacementHeuristic(found_among_the_seen).choose(cloud, pulled(cloud))
    assert len(found.displacement) == len(found.keypoints.initial) > 200
    assert found.point[0] == pytest.approx(0.05, abs=1e-3)
    assert found.point[2] < 0.02
    assert np.linalg.norm(cloud - found.point, axis=1).min() > 0.004


def test_displacements_of_hidden_keypoints_follow_an_affine_map_beyond_those_known() -> None:
    known = farthest_points(box_top_and_front(), 200)
    stretch = np.array([[1.1, 0.2, 0.0], [0.0, 0.9, 0.1], [0.1, 0.0, 1.2]], np.float32)
    hidden = np.array([[0.05, 0.0, 0.01], [0.05, 0.03, 0.02]], np.float32)
    found = with_hidden(Keypoints(known, known @ stretch, 0.0), hidden)
    np.testing.assert_allclose(found.initial[200:], hidden)
    np.testing.assert_allclose(found.goal[200:], hidden @ stretch, atol=1e-5)
    np.testing.assert_array_equal(found.goal[:200], known @ stretch)


def test_hidden_keypoints_of_a_plane_move_as_the_nearest() -> None:
    known = farthest_points(slab(), 50)
    lift = np.array([0.0, 0.0, 0.01], np.float32)
    moved = known + lift
    hidden = np.array([[0.05, 0.0, 0.01]], np.float32)
    found = with_hidden(Keypoints(known, moved, 0.0), hidden)
    np.testing.assert_allclose(found.goal[50:], hidden + lift, atol=1e-6)
