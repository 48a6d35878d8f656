"""Trained networks on disk: safetensors for the weights, JSON for all else, never a pickle."""

import json
import struct
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, TypeVar, get_args

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save as save_tensors
from torch import Tensor

from dnet.errors import BadCheckpoint, TooLarge
from dnet.files.sizes import parse_json
from dnet.files.whole_file import write_whole
from dnet.nets.deformernet import Coordinates, DeformerNet, DeformerNetConfig
from dnet.nets.hu import HuNet, HuNetConfig
from dnet.nets.keypoints import KeypointNet
from dnet.nets.manipulation_point import DensePredictor, PointRegressor
from dnet.nets.neighbourhoods import Size
from dnet.nets.pointconv import Norm
from dnet.training.objectives import Network

N = TypeVar("N", bound=Network)

BEST = "best.safetensors"
"""The file that stands for a run directory: the network with the smallest validation error."""

LARGEST_CHECKPOINT = 2**30
"""Bytes of a file that are still read; the largest network here has 7 MB, and four times that with
all that a training goes on from."""
LARGEST_HEADER = 16 * 2**20
"""Bytes of what a file says of its tensors; dnet writes 20 KB. Parsed, it takes many times that."""

_LENGTH = struct.Struct("<Q")

# One entry of the header for all: safetensors writes several in a random order, and the same
# network should give the same bytes.
_KEY = "dnet"
_HINT = "give a run directory or a .safetensors file of `dnet train`"


def save(path: Path, network: Network, *, metrics: Mapping[str, Any] | None = None) -> None:
    """Write a network into the file `path`, whole or not at all.

    The file alone is enough to load the network: its header says what the weights are of.

    Args:
        path: A `.safetensors` file, replaced if it exists.
        network: To be written.
        metrics: What is known of it, as JSON, for people.
    """
    write_tensors(path, network.state_dict(), header_of(network, metrics))


def header_of(network: Network, metrics: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return what a file says of the network that it holds, as JSON."""
    return {
        "network": type(network).__name__,
        "config": asdict(network.config),
        "metrics": dict(metrics or {}),
    }


def write_tensors(path: Path, tensors: Mapping[str, Tensor], header: Mapping[str, Any]) -> None:
    """Write tensors and a JSON header into the file `path`, whole or not at all."""
    # Clones: a network that is trained on goes on changing, and some tensors share memory.
    kept = {name: tensor.detach().cpu().contiguous().clone() for name, tensor in tensors.items()}
    write_whole(path, save_tensors(kept, metadata={_KEY: json.dumps(header)}))


def read_tensors(path: Path) -> tuple[dict[str, Any], dict[str, Tensor]]:
    """Return the header and the tensors of a file of `write_tensors`.

    Raises:
        BadCheckpoint: If there is no such file, or it is corrupt.
        TooLarge: If it is larger than any network.
    """
    return _read(path)


def load(path: Path) -> DeformerNet:
    """Return the DeformerNet that `path` holds, on the CPU and ready to predict.

    Args:
        path: A run directory, whose best network is taken, or a `.safetensors` file.

    Raises:
        BadCheckpoint: If there is no such file, or it is corrupt, or of another network.
        TooLarge: If it is larger than any network.
    """
    return load_kind(path, DeformerNet)


def load_kind(path: Path, kind: type[N]) -> N:
    """Return the network of one kind that `path` holds, on the CPU and ready to predict.

    Args:
        path: A run directory, whose best network is taken, or a `.safetensors` file.
        kind: The network that it must be.

    Raises:
        BadCheckpoint: If there is no such file, or it is corrupt, or of another network.
        TooLarge: If it is larger than any network.
    """
    network = load_any(path)
    if not isinstance(network, kind):
        found = f"holds {type(network).__name__}, not {kind.__name__}"
        raise BadCheckpoint(weights_file(path), found, _HINT)
    return network


def load_any(path: Path) -> Network:
    """Return the network that `path` holds, of whichever kind, on the CPU and ready to predict.

    Raises:
        BadCheckpoint: If there is no such file, or it is corrupt, or of an unknown network.
        TooLarge: If it is larger than any network.
    """
    file = weights_file(path)
    header, weights = _read(file)
    kinds = {kind.__name__: kind for kind in get_args(Network)}
    name = header.get("network", "an unnamed network")
    if name not in kinds:
        raise BadCheckpoint(file, f"holds {name}, not one of {', '.join(kinds)}", _HINT)
    of = hu_config_of if name == HuNet.__name__ else config_of
    network: Network = kinds[name](of(file, header.get("config")))
    _check_shapes(file, weights, network.state_dict())
    network.load_state_dict(weights)
    return network.eval()


def begin_with(model: Network, path: Path) -> None:
    """Give `model` the weights that `path` holds, or what it needs of a DeformerNet's.

    A dense predictor takes over all of it, as its guide; others its encoder.

    Args:
        model: An untrained network.
        path: A run directory, whose best network is taken, or a `.safetensors` file.

    Raises:
        BadCheckpoint: If there is no such file, or it is corrupt, or of another network.
        TooLarge: If it is larger than any network.
    """
    held = load_any(path)
    alike = type(held) is type(model)
    serves = isinstance(held, DeformerNet) and not isinstance(model, HuNet)
    if not (alike or serves):
        wanted = [type(model).__name__, *([] if isinstance(model, HuNet) else ["DeformerNet"])]
        found = f"holds {type(held).__name__}, not {' or '.join(wanted)}"
        raise BadCheckpoint(path, found, _HINT)
    for name, value in asdict(model.config).items():
        # It may have looked at more points or fewer.
        if (other := getattr(held.config, name)) != value and name != "points":
            why = f"is of a network with {name} {other}, not {value}"
            raise BadCheckpoint(path, why, "give the options that it was trained with")
    if isinstance(held, DeformerNet) and isinstance(model, DensePredictor):
        model.guide.load_state_dict(held.state_dict())
    elif isinstance(held, DeformerNet) and isinstance(model, PointRegressor | KeypointNet):
        model.encoder.load_state_dict(held.encoder.state_dict())
    else:
        model.load_state_dict(held.state_dict())


def read_metrics(path: Path) -> dict[str, Any]:
    """Return what was written as `metrics` when `path` was saved.

    Raises:
        BadCheckpoint: If there is no such file, or it is corrupt.
        TooLarge: If it is larger than any network.
    """
    header, _ = _read(weights_file(path))
    metrics = header.get("metrics")
    return metrics if isinstance(metrics, dict) else {}


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write `content` into the file `path`, whole or not at all."""
    write_whole(path, (json.dumps(content, indent=2) + "\n").encode())


def weights_file(path: Path) -> Path:
    """Return the file of a network: `path` itself, or the best one of a run directory.

    Raises:
        BadCheckpoint: If there is no such file.
    """
    file = path / BEST if path.is_dir() else path
    if not file.is_file():
        raise BadCheckpoint(file, "does not exist", _HINT)
    return file


def _read(file: Path) -> tuple[dict[str, Any], dict[str, Tensor]]:
    try:
        _check_sizes(file)
        with safe_open(file, framework="pt", device="cpu") as content:
            text = (content.metadata() or {}).get(_KEY, "{}")
            weights = {name: content.get_tensor(name) for name in content.keys()}  # noqa: SIM118
    except TooLarge:
        raise
    except (SafetensorError, OSError, ValueError) as error:
        raise BadCheckpoint(file, f"is not a whole safetensors file ({error})", _HINT) from error
    try:
        header = parse_json(text)
    except ValueError as error:
        raise BadCheckpoint(file, f"has an unreadable header ({error})", _HINT) from error
    return header if isinstance(header, dict) else {}, weights


def _check_sizes(file: Path) -> None:
    """Refuse a file that would take more memory than a network can.

    Raises:
        TooLarge: If it has too many bytes, or its header has.
    """
    size = file.stat().st_size
    if size > LARGEST_CHECKPOINT:
        raise TooLarge("checkpoint", file, size, LARGEST_CHECKPOINT)
    with file.open("rb") as opened:
        (header,) = _LENGTH.unpack(opened.read(_LENGTH.size).ljust(_LENGTH.size, b"\0"))
    # Of a file that is none the first bytes say anything.
    if LARGEST_HEADER < header < size:
        raise TooLarge("header of the checkpoint", file, header, LARGEST_HEADER)


def config_of(file: Path, fields: Any) -> DeformerNetConfig:
    """Return the config that the header of a file holds.

    Raises:
        BadCheckpoint: If it holds none, or one of a network that is not known here.
    """
    try:
        config = DeformerNetConfig(
            size=fields["size"],
            norm=fields["norm"],
            points=int(fields["points"]),
            coordinates=fields["coordinates"],
            density=bool(fields["density"]),
            motion_unit=float(fields["motion_unit"]),
        )
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise BadCheckpoint(file, f"has an unreadable config ({error!r})", _HINT) from error
    for what, kind in (("size", Size), ("norm", Norm), ("coordinates", Coordinates)):
        if getattr(config, what) not in get_args(kind):
            got = getattr(config, what)
            raise BadCheckpoint(file, f"is of {what} {got!r}", "install a newer dnet")
    return config


def hu_config_of(file: Path, fields: Any) -> HuNetConfig:
    """Return the config of a network of Hu et al. that the header of a file holds.

    Raises:
        BadCheckpoint: If it holds none.
    """
    try:
        x, y, z = (float(place) for place in fields["eye"])
        return HuNetConfig(
            points=int(fields["points"]),
            components=int(fields["components"]),
            relu=bool(fields["relu"]),
            eye=(x, y, z),
            motion_unit=float(fields["motion_unit"]),
        )
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise BadCheckpoint(file, f"has an unreadable config ({error!r})", _HINT) from error


def _check_shapes(file: Path, got: Mapping[str, Tensor], want: Mapping[str, Tensor]) -> None:
    for name in [*want, *got]:
        if name not in got:
            raise BadCheckpoint(file, f"lacks the weights {name}", _HINT)
        if name not in want:
            raise BadCheckpoint(file, f"has unknown weights {name}", _HINT)
        if got[name].shape != want[name].shape:
            shapes = f"{tuple(got[name].shape)}, not {tuple(want[name].shape)}"
            raise BadCheckpoint(file, f"has weights {name} of shape {shapes}", _HINT)
        if not torch.isfinite(got[name]).all():
            raise BadCheckpoint(file, f"has weights {name} that are not numbers", "train it again")
