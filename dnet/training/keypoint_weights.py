"""Keypoint networks on disk: safetensors whose header says what the weights are of."""

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from torch import Tensor

from dnet.errors import BadCheckpoint
from dnet.nets.deformernet import DeformerNetConfig
from dnet.nets.keypoints import KeypointNet, KeypointNetConfig
from dnet.training.checkpoints import read_tensors, write_tensors

_NETWORK = "KeypointNet"
_HINT = "give a .safetensors file of a keypoint network"


def save_keypoint_net(
    path: Path,
    weights: Mapping[str, Tensor],
    *,
    config: KeypointNetConfig,
    metrics: Mapping[str, Any] | None = None,
) -> None:
    """Write a network into the `.safetensors` file `path`, whole or not at all.

    Args:
        path: Replaced if it exists.
        weights: The network's `state_dict()`.
        config: Of the network.
        metrics: What is known of it, as JSON, for people.
    """
    header = {"network": _NETWORK, "config": asdict(config), "metrics": dict(metrics or {})}
    write_tensors(path, weights, header)


def load_keypoint_net(path: Path) -> KeypointNet:
    """Return the network that the file `path` holds, on the CPU and ready to find keypoints.

    Raises:
        BadCheckpoint: If there is no such file, or it is corrupt, or of another network.
    """
    if not path.is_file():
        raise BadCheckpoint(path, "does not exist", _HINT)
    header, weights = read_tensors(path)
    if header.get("network") != _NETWORK:
        found = header.get("network", "an unnamed network")
        raise BadCheckpoint(path, f"holds {found}, not {_NETWORK}", _HINT)
    try:
        fields = dict(header["config"])
        cloud = DeformerNetConfig(**fields.pop("cloud"))
        net = KeypointNet(KeypointNetConfig(cloud=cloud, **fields))
        net.load_state_dict(weights)
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise BadCheckpoint(path, f"does not hold what it says ({error})", _HINT) from error
    return net.eval()
