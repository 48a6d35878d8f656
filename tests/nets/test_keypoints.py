import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from dnet.errors import BadCloud, ShortCloud, TooFew
from dnet.geometry.sampling import farthest_points
from dnet.nets.deformernet import DeformerNetConfig, prepare
from dnet.nets.keypoints import KeypointNet, in_own_order
from dnet.nets.neighbourhoods import stack
from dnet.types import Cloud

CONFIG = DeformerNetConfig(points=192)
COUNT = 40


@pytest.fixture(scope="module")
def net() -> KeypointNet:
    torch.manual_seed(0)
    return KeypointNet(CONFIG, count=COUNT).eval()


def box(seed: int, points: int = 192) -> Cloud:
    """A sheared box, seen as a cloud."""
    rng = np.random.default_rng(seed)
    inside = rng.uniform([-0.05, -0.05, 0], [0.05, 0.05, 0.04], (points, 3))
    return (inside @ (np.eye(3) + rng.uniform(-0.5, 0.5, (3, 3)))).astype(np.float32)


@pytest.mark.parametrize("seed", [0, 1])
def test_a_cloud_stays_where_it_is_on_the_way_to_itself(net: KeypointNet, seed: int) -> None:
    found = net.keypoints(box(seed), box(seed))
    np.testing.assert_array_equal(found.goal, found.initial)
    assert found.residual == 0.0


@given(seed=st.integers(0, 99))
@settings(max_examples=5, deadline=None)
def test_the_order_of_points_does_not_matter(net: KeypointNet, seed: int) -> None:
    shuffle = np.random.default_rng(seed).permutation
    plain = net.keypoints(box(0), box(1))
    other = net.keypoints(shuffle(box(0)), shuffle(box(1)))
    np.testing.assert_array_equal(other.initial, plain.initial)
    # Sums over clouds come out in another order.
    np.testing.assert_allclose(other.goal, plain.goal, atol=1e-6)
    assert other.residual == pytest.approx(plain.residual, abs=1e-6)


def test_keypoints_are_points_of_the_initial_cloud_that_cover_it(net: KeypointNet) -> None:
    cloud = box(0)
    found = net.keypoints(cloud, box(1)).initial
    assert len(found) == COUNT == len(np.unique(found, axis=0))
    nearest = np.linalg.norm(cloud[:, None] - found, axis=2).min(axis=1)
    apart = np.linalg.norm(found[:, None] - found, axis=2) + np.eye(len(found))
    assert nearest.max() <= apart.min(), "each was the farthest from those before it"


def test_clouds_of_different_sizes_are_thinned(net: KeypointNet) -> None:
    large = box(0, 400)
    found = net.keypoints(large, box(1, 250))
    assert found.goal.shape == (40, 3)
    assert {tuple(point) for point in found.initial.tolist()} <= {
        tuple(point) for point in large.tolist()
    }


def test_a_batch_is_as_one_by_one(net: KeypointNet) -> None:
    clouds = [farthest_points(box(seed), 192) for seed in range(4)]
    seen = [prepare(cloud, CONFIG) for cloud in clouds]
    points = torch.stack([one.points for one in seen])
    with torch.no_grad():
        features = net.encode(stack(seen))
        both = net.displacements(points[:2], features[:2], features[2:])
        for k in range(2):
            one = slice(k, k + 1)
            other = slice(k + 2, k + 3)
            alone = net.displacements(
                points[one], net.encode(stack([seen[k]])), net.encode(stack([seen[k + 2]]))
            )
            torch.testing.assert_close(alone, both[one], atol=1e-5, rtol=1e-4)
            apart = net.displacements(points[one, :7], features[one], features[other])
            torch.testing.assert_close(apart[0], both[k, :7], atol=1e-6, rtol=1e-5)


def test_a_short_or_broken_cloud_is_refused(net: KeypointNet) -> None:
    with pytest.raises(ShortCloud, match="191 points, need at least 192"):
        net.keypoints(box(0)[:191], box(1))
    broken = box(1)
    broken[3, 0] = np.nan
    with pytest.raises(BadCloud, match="goal cloud has 1 of 192"):
        net.keypoints(box(0), broken)


def test_a_cloud_has_a_keypoint_at_least_and_no_more_than_it_has_points() -> None:
    with pytest.raises(TooFew, match="number of keypoints is 0"):
        KeypointNet(CONFIG, count=0)
    assert KeypointNet(DeformerNetConfig(points=150)).count == 150


def test_an_order_of_its_own_begins_far_from_the_middle() -> None:
    cloud = box(0)
    ordered = in_own_order(cloud, len(cloud), least=20)
    away = np.linalg.norm(cloud - cloud.mean(axis=0), axis=1)
    np.testing.assert_array_equal(ordered[0], cloud[away.argmax()])
    np.testing.assert_array_equal(
        ordered[:20], farthest_points(cloud, 20, start=int(away.argmax()))
    )
    np.testing.assert_array_equal(np.unique(ordered, axis=0), np.unique(cloud, axis=0))
