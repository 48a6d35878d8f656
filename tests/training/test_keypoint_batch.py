import pytest
import torch
from torch import Tensor

from dnet.nets.deformernet import prepare
from dnet.nets.keypoints import KeypointNet
from dnet.nets.neighbourhoods import Neighbourhoods, stack
from dnet.training.keypoint_batch import KeypointObjective
from tests.training.deforming_box import SMALL, BoxEpisode

CURRENT, GOAL = (
    torch.tensor(rows)
    for rows in zip(*((a, b) for a in range(6) for b in range(6) if a != b), strict=True)
)


@pytest.fixture(scope="module")
def seen() -> Neighbourhoods:
    return stack([prepare(frame.cloud, SMALL) for frame in BoxEpisode(0).frames])


def new_net() -> KeypointNet:
    torch.manual_seed(0)
    return KeypointNet(SMALL)


def loss_of(net: KeypointNet, seen: Neighbourhoods) -> Tensor:
    objective = KeypointObjective(points=96)
    features = net.encode(seen)
    return objective.loss(net, seen.points, features, current=CURRENT, goal=GOAL).total.mean()


def test_a_pair_has_the_loss_that_it_has_alone(seen: Neighbourhoods) -> None:
    net = new_net()
    features = net.encode(seen)
    objective = KeypointObjective(points=96)
    both = objective.loss(net, seen.points, features, current=CURRENT, goal=GOAL).total
    there_and_back = torch.tensor([0, 1]), torch.tensor([1, 0])
    for k in (0, 2):
        group = slice(k, k + 2)
        alone = objective.loss(
            net,
            seen.points[group],
            features[group],
            current=there_and_back[0],
            goal=there_and_back[1],
        )
        of = (k == CURRENT) & (k + 1 == GOAL) | (k + 1 == CURRENT) & (k == GOAL)
        torch.testing.assert_close(alone.total, both[of])


def test_training_brings_clouds_to_their_goals(seen: Neighbourhoods) -> None:
    net = new_net()
    optimizer = torch.optim.Adam(net.parameters(), lr=3e-3)
    first = loss_of(net, seen).item()
    for _ in range(30):
        optimizer.zero_grad()
        torch.autograd.backward(loss_of(net, seen))
        optimizer.step()
    assert loss_of(net, seen).item() < 0.8 * first
    for name, weights in net.named_parameters():
        assert (weights.grad is None) == name.startswith("encoder."), name
