"""A controller that learns from its own motions finds out what they do."""

from dataclasses import dataclass, field

import numpy as np
import pytest
import torch

from dnet.nets.hu import HuNet, HuNetConfig, features_of
from dnet.servo.online import OnlineHu
from dnet.types import Cloud, Point

CONFIG = HuNetConfig(points=300, components=8, relu=False)


def sheet(tip: Point) -> Cloud:
    """A sheet whose shape is a function of where it is held."""
    x, y = np.random.default_rng(0).uniform(-0.05, 0.05, (2, CONFIG.points))
    near = np.exp(-((x - 0.02) ** 2 + y**2) / 0.03**2)
    bent = np.column_stack([x, y, np.zeros_like(x)]) + near[:, None] * tip
    return bent.astype(np.float32)


@pytest.fixture(scope="module")
def network() -> HuNet:
    tips = np.random.default_rng(1).uniform([-0.02, -0.02, 0], [0.02, 0.02, 0.03], (60, 3))
    features = np.stack([features_of(sheet(tip), CONFIG) for tip in tips])
    torch.manual_seed(0)
    network = HuNet(CONFIG)
    network.fit(features, np.zeros(60, np.int64))
    return network


@dataclass
class Hand:
    tip: Point = field(default_factory=lambda: np.array([0.0, 0.0, 0.005]))


def test_it_begins_as_it_was_trained_and_leaves_the_network_as_it_was(network: HuNet) -> None:
    hand, goal = Hand(), sheet(np.array([0.0, 0.0, 0.02]))
    online = OnlineHu(network, lambda: hand.tip)
    before = {name: value.clone() for name, value in network.state_dict().items()}
    np.testing.assert_array_equal(
        online.predict(sheet(hand.tip), goal), network.predict(sheet(hand.tip), goal)
    )
    hand.tip = hand.tip + np.array([0.0, 0.0, 0.004])
    online.predict(sheet(hand.tip), goal)
    for name, value in network.state_dict().items():
        assert torch.equal(value, before[name])


def test_what_a_motion_did_is_learned(network: HuNet) -> None:
    hand = Hand()
    online = OnlineHu(network, lambda: hand.tip)
    tips = [hand.tip + np.array([0.0, 0.0, 0.003]) * step for step in range(6)]

    def error(of: OnlineHu | HuNet) -> float:
        model = of.network if isinstance(of, OnlineHu) else of
        found = model.predict(sheet(tips[0]), sheet(tips[-1]))
        return float(np.linalg.norm(found - (tips[-1] - tips[0])))

    untaught = error(network)
    for hand.tip in tips:
        online.predict(sheet(hand.tip), sheet(tips[-1]))
    assert error(online) < 0.3 * untaught


def test_the_same_run_learns_the_same(network: HuNet) -> None:
    def last_motion() -> Point:
        hand, goal = Hand(), sheet(np.array([0.0, 0.01, 0.02]))
        online, motion = OnlineHu(network, lambda: hand.tip), np.zeros(3)
        for _ in range(3):
            motion = online.predict(sheet(hand.tip), goal)
            hand.tip = hand.tip + np.clip(motion, -0.004, 0.004)
        return motion

    np.testing.assert_array_equal(last_motion(), last_motion())


def test_a_tip_that_went_farther_than_asked_has_grasped_anew(network: HuNet) -> None:
    hand, goal = Hand(), sheet(np.array([0.0, 0.0, 0.02]))
    online = OnlineHu(network, lambda: hand.tip)
    asked = online.predict(sheet(hand.tip), goal)
    hand.tip = hand.tip + np.array([0.02 + float(np.linalg.norm(asked)), 0.0, 0.0])
    np.testing.assert_array_equal(
        online.predict(sheet(hand.tip), goal), network.predict(sheet(hand.tip), goal)
    )
