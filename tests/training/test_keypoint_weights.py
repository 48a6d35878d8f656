from pathlib import Path

import pytest
import torch

from dnet.errors import BadCheckpoint
from dnet.nets.deformernet import DeformerNet, DeformerNetConfig
from dnet.nets.keypoints import KeypointNet, KeypointNetConfig
from dnet.training.checkpoints import save, write_tensors
from dnet.training.keypoint_weights import load_keypoint_net, save_keypoint_net

CONFIG = KeypointNetConfig(cloud=DeformerNetConfig(points=160), keypoints=40, fields=8, width=16)


def test_what_was_saved_is_what_is_loaded(tmp_path: Path) -> None:
    net = KeypointNet(CONFIG)
    path = tmp_path / "deep" / "keypoints.safetensors"
    save_keypoint_net(path, net.state_dict(), config=CONFIG)
    loaded = load_keypoint_net(path)
    assert loaded.config == CONFIG
    assert not loaded.training
    for name, weights in loaded.state_dict().items():
        assert torch.equal(weights, net.state_dict()[name]), name


def test_other_networks_and_damaged_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "net.safetensors"
    with pytest.raises(BadCheckpoint, match="does not exist"):
        load_keypoint_net(path)
    path.write_bytes(b"no weights")
    with pytest.raises(BadCheckpoint, match="not a whole safetensors file"):
        load_keypoint_net(path)
    net = DeformerNet(CONFIG.cloud)
    save(path, net.state_dict(), config=net.config)
    with pytest.raises(BadCheckpoint, match="holds DeformerNet, not KeypointNet"):
        load_keypoint_net(path)
    write_tensors(path, {}, {"network": "KeypointNet", "config": {"cloud": {}, "width": 16}})
    with pytest.raises(BadCheckpoint, match="does not hold what it says"):
        load_keypoint_net(path)
