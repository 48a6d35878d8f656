import pytest
import torch

from dnet.nets.hu import HuNet, HuNetConfig
from dnet.training.components import find_components
from dnet.training.division import thinned
from dnet.training.examples import stream_of
from dnet.training.frames import Frames
from dnet.training.objectives import MotionError
from dnet.training.parallel import Process
from dnet.training.settings import TrainingSettings
from dnet.training.tasks import TASKS
from dnet.training.training import Training
from tests.training.deforming_box import SMALL, box_frames

CONFIG = HuNetConfig(points=SMALL.points, components=12)


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Frames:
    return box_frames(tmp_path_factory.mktemp("boxes"), [0, 1], config=CONFIG)


def new_net() -> HuNet:
    torch.manual_seed(0)
    return HuNet(CONFIG)


def test_the_same_frames_give_the_same_components_and_others_others(frames: Frames) -> None:
    one, again, other = new_net(), new_net(), new_net()
    assert not one.fitted
    for net in (one, again):
        TASKS["hu"].fit(net, frames)
    find_components(other, Frames.of(thinned(frames.table, 6), CONFIG))
    assert one.fitted
    assert torch.equal(one.basis, again.basis)
    assert not torch.equal(one.basis, other.basis)


def test_a_network_keeps_the_components_that_it_was_trained_with(frames: Frames) -> None:
    net = new_net()
    find_components(net, Frames.of(thinned(frames.table, 6), CONFIG))
    kept = net.basis.clone()
    find_components(net, frames)
    assert torch.equal(net.basis, kept)


def test_a_training_keeps_its_components_also_when_it_is_taken_up(frames: Frames) -> None:
    settings = TrainingSettings(epochs=2, groups=2, frames=3, augmentation=None)

    def begin(net: HuNet) -> Training:
        return Training(MotionError(net), stream_of(frames, settings, process=Process()), settings)

    net, other = new_net(), new_net()
    find_components(net, frames)
    find_components(other, Frames.of(thinned(frames.table, 6), CONFIG))
    basis = net.basis.clone()
    first = begin(net)
    for _ in first.epoch():
        pass
    first.close_epoch()
    second = begin(other)
    # As a file would hold them: what goes on changing is not shared.
    held = {name: tensor.clone() for name, tensor in first.tensors().items()}
    second.load(held, first.facts())
    for training in (first, second):
        for _ in training.epoch():
            pass
        assert torch.equal(training.average.state_dict()["basis"], basis)
    for name, tensor in first.average.state_dict().items():
        assert torch.equal(tensor, second.average.state_dict()[name]), name
