import pytest
import torch

from dnet.nets.keypoints import KeypointNet
from dnet.training.examples import stream_of
from dnet.training.feature_scale import scale_features
from dnet.training.frames import Frames
from dnet.training.objectives import CarryingError
from dnet.training.parallel import Process
from dnet.training.settings import TrainingSettings
from dnet.training.tasks import TASKS
from dnet.training.training import Training
from tests.training.deforming_box import SMALL, box_frames

ALL = torch.arange(12).numpy()


@pytest.fixture(scope="module")
def frames(tmp_path_factory: pytest.TempPathFactory) -> Frames:
    return box_frames(tmp_path_factory.mktemp("boxes"), [0, 1])


def new_net() -> KeypointNet:
    torch.manual_seed(0)
    return KeypointNet(SMALL)


def test_channels_that_vary_have_mean_zero_and_variance_one(frames: Frames) -> None:
    net = new_net()
    before = net.encode(frames.prepared(ALL))
    scale_features(net, frames)
    after = net.encode(frames.prepared(ALL))
    vary = before.std(dim=0, correction=0) > 2e-3
    assert int(vary.sum()) > 0
    torch.testing.assert_close(after.mean(dim=0), torch.zeros(256), atol=1e-3, rtol=0)
    found = after.std(dim=0, correction=0)[vary]
    torch.testing.assert_close(found, torch.ones_like(found), atol=1e-3, rtol=0)


def test_a_channel_that_says_nothing_is_not_scaled() -> None:
    net = new_net()
    features = torch.randn(20, 256, generator=torch.Generator().manual_seed(0))
    features[:, 3] = 0.25
    net.scale(features)
    assert float(net.spread[3]) == 1.0
    assert float(net.middle[3]) == 0.25
    assert float(net.spread[4]) == pytest.approx(float(features[:, 4].std(correction=0)))


def test_features_that_are_scaled_stay_as_they_are(frames: Frames) -> None:
    net = new_net()
    assert not net.scaled
    scale_features(net, frames)
    assert net.scaled
    kept = {name: tensor.clone() for name, tensor in net.state_dict().items()}
    scale_features(net, frames)
    assert all(torch.equal(kept[name], tensor) for name, tensor in net.state_dict().items())


def test_the_same_frames_give_the_same_scale_and_another_network_another(frames: Frames) -> None:
    one, again, other = new_net(), new_net(), KeypointNet(SMALL)
    for net in (one, again, other):
        TASKS["keypoints"].fit(net, frames)
    assert torch.equal(one.spread, again.spread)
    assert torch.equal(one.middle, again.middle)
    assert not torch.equal(one.spread, other.spread)


def test_a_training_keeps_the_scale_it_began_with_also_when_it_is_taken_up(
    frames: Frames,
) -> None:
    settings = TrainingSettings(epochs=2, groups=2, frames=3, augmentation=None)

    def begin(net: KeypointNet) -> Training:
        return Training(
            CarryingError(net), stream_of(frames, settings, process=Process()), settings
        )

    net = new_net()
    scale_features(net, frames)
    scale = net.spread.clone()
    first = begin(net)
    for _ in first.epoch():
        pass
    first.close_epoch()
    second = begin(new_net())
    # As a file would hold them: what goes on changing is not shared.
    held = {name: tensor.clone() for name, tensor in first.tensors().items()}
    second.load(held, first.facts())
    for training in (first, second):
        average = training.average
        assert isinstance(average, KeypointNet)
        assert torch.equal(average.spread, scale)
        for _ in training.epoch():
            pass
    for name, tensor in first.average.state_dict().items():
        assert torch.equal(tensor, second.average.state_dict()[name]), name
