import numpy as np
import pytest

from dnet.geometry.hidden_sides import SIDE_POINTS, hidden_sides, side_normals
from dnet.types import Cloud

SIZE = np.array([0.1, 0.08, 0.04])


def seen_box(turn: float = 0.0, shift: float = 0.0) -> Cloud:
    """The top and one long side of a box on a table."""
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.5, 0.5, (3000, 3))
    points[:2000, 2], points[2000:, 1] = 0.5, -0.5
    points = points * SIZE + [0, 0, SIZE[2] / 2]
    cosine, sine = np.cos(turn), np.sin(turn)
    rotation = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    return (points @ rotation.T + [shift, 0, 0]).astype(np.float32)


def test_all_four_sides_of_a_box_are_found_down_to_the_table() -> None:
    walls = hidden_sides(seen_box())
    assert walls.shape == (SIDE_POINTS, 3)
    off = np.abs(np.abs(walls[:, :2]) - SIZE[:2] / 2).min(axis=1)
    assert off.max() < 0.002
    assert walls[:, 2].min() < 0.005
    assert 0.033 < walls[:, 2].max() < SIZE[2]
    for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1)):
        side = sign * walls[:, axis] > SIZE[axis] / 2 - 0.002
        other = 1 - axis
        assert np.ptp(walls[side, other]) > 0.9 * SIZE[other]


@pytest.mark.parametrize("turn", [0.3, 1.2])
def test_the_sides_turn_and_shift_with_the_object(turn: float) -> None:
    walls = hidden_sides(seen_box(turn, 0.02))
    cosine, sine = np.cos(turn), np.sin(turn)
    back = (walls - [0.02, 0, 0]) @ np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    assert np.abs(np.abs(back[:, :2]) - SIZE[:2] / 2).min(axis=1).max() < 0.002


def test_a_unit_does_not_matter_and_the_same_cloud_has_the_same_sides() -> None:
    cloud = seen_box()
    np.testing.assert_allclose(hidden_sides(10 * cloud), 10 * hidden_sides(cloud), atol=1e-4)
    np.testing.assert_array_equal(hidden_sides(cloud), hidden_sides(cloud.copy()))


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_normals_of_sides_point_outwards_and_are_square_to_them(turn: float) -> None:
    walls = hidden_sides(seen_box(turn))
    found = side_normals(walls)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0)
    assert not found[:, 2].any()
    assert ((walls[:, :2] * found[:, :2]).sum(axis=1) > 0).all()
    cosine, sine = np.cos(turn), np.sin(turn)
    rotation = np.array([[cosine, -sine], [sine, cosine]])
    straight = np.abs(found[:, :2] @ rotation).max(axis=1)
    # All but the steps next to the four corners.
    assert (straight > 0.999).mean() > 0.85
