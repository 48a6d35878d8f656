import numpy as np
import pytest
import torch

from dnet.errors import BadCloud, ShortCloud
from dnet.nets.hu import HuNet, HuNetConfig, principal_components

CONFIG = HuNetConfig(points=160, components=4)


def features(seed: int = 0, count: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Three episodes far from each other, whose frames vary along three axes."""
    rng = np.random.default_rng(seed)
    episodes = np.repeat(np.arange(3), count // 3)
    axes = np.linalg.qr(rng.normal(size=(135, 3)))[0]
    varied = (rng.normal(size=(count, 3)) * [3.0, 1.0, 0.3]) @ axes.T
    return (5 * rng.normal(size=(3, 135))[episodes] + varied).astype(np.float32), episodes


def fitted(*, relu: bool = True) -> HuNet:
    torch.manual_seed(0)
    network = HuNet(HuNetConfig(points=160, components=4, relu=relu))
    network.fit(*features())
    return network


def test_differences_within_episodes_have_unit_variance_and_no_correlation() -> None:
    values, episodes = features()
    found = values @ principal_components(values, episodes, count=3)
    pairs = np.concatenate(
        [
            (found[own][:, None] - found[own][None]).reshape(-1, 3)
            for own in (episodes == number for number in range(3))
        ]
    )
    # All ordered pairs with those of a frame and itself: of n frames, n of n^2 are zero.
    np.testing.assert_allclose(pairs.T @ pairs / len(pairs), np.eye(3), atol=1e-3)


def test_components_come_in_the_order_of_their_variance() -> None:
    values, episodes = features()
    basis = principal_components(values, episodes, count=3)
    assert (np.diff(np.linalg.norm(basis, axis=0)) > 0).all()


def test_components_without_variance_are_left_out() -> None:
    values, episodes = features()
    basis = principal_components(values, episodes, count=5)
    assert (np.abs(basis[:, :3]).max(axis=0) > 0).all()
    np.testing.assert_array_equal(basis[:, 3:], 0)
    np.testing.assert_array_equal(principal_components(0 * values, episodes, count=5), 0)


def test_components_do_not_depend_on_the_order_of_frames() -> None:
    values, episodes = features()
    order = np.random.default_rng(1).permutation(len(values))
    np.testing.assert_allclose(
        principal_components(values[order], episodes[order], count=3),
        principal_components(values, episodes, count=3),
        rtol=1e-3,
        atol=1e-6,
    )


def test_without_relu_it_is_a_linear_map() -> None:
    for relu in (True, False):
        network = fitted(relu=relu)
        one, other = torch.randn(2, 50, 4)
        none = torch.zeros(50, 4)
        bias = network.motion(none, none)
        apart = network.motion(none, one) + network.motion(none, other) - bias
        together = network.motion(none, one + other)
        assert torch.allclose(apart, together, atol=1e-6) == (not relu)


def cloud(seed: int = 0, count: int = 160) -> np.ndarray:
    x, y = np.random.default_rng(seed).uniform(-0.05, 0.05, (2, count))
    return np.column_stack([x, y, 10 * x**2 + 0.01 * seed * y]).astype(np.float32)


def test_a_motion_is_predicted_from_two_clouds_alone() -> None:
    network = fitted()
    motion = network.predict(cloud(0), cloud(9))
    assert motion.shape == (3,)
    assert motion.dtype == np.float64
    np.testing.assert_array_equal(motion, network.predict(cloud(0), cloud(9)))
    more = np.concatenate([cloud(0), cloud(0, 40)])
    assert np.isfinite(network.predict(more, cloud(9))).all()


def test_the_motion_to_the_same_shape_anywhere_else_is_the_same() -> None:
    network = fitted()
    here = network.predict(cloud(0), cloud(0))
    # Features say nothing of where a surface is: 1 mm to the side may only turn a bin's edge.
    shifted = cloud(0) + np.array([0.001, 0, 0], np.float32)
    assert np.abs(network.predict(cloud(0), shifted) - here).max() < 5e-3


def test_clouds_that_will_not_do_are_refused() -> None:
    bad = cloud()
    bad[3, 1] = np.nan
    with pytest.raises(ShortCloud):
        fitted().predict(cloud(count=100), cloud())
    with pytest.raises(BadCloud, match="goal cloud"):
        fitted().predict(cloud(), bad)
