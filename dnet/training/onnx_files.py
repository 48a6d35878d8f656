"""Trained networks as ONNX files: written once they are proven to agree, and read again."""

import copy
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from dnet.errors import BadCheckpoint, Disagreement, MissingExtra
from dnet.files.whole_file import write_whole
from dnet.nets.deformernet import DeformerNet
from dnet.nets.onnx_agreement import LIMIT, Agreement, agreement
from dnet.nets.onnx_network import FEATURES, GOAL, MOTION, TABLES, OnnxDeformerNet, open_session
from dnet.training.checkpoints import config_of, header_of

SUFFIX = ".onnx"

_KEY = "dnet"
_HINT = "give a file that `dnet export` wrote"
_NETWORK = DeformerNet.__name__


def export(
    model: DeformerNet, path: Path, *, metrics: Mapping[str, Any] | None = None
) -> tuple[OnnxDeformerNet, Agreement]:
    """Write a network into the ONNX file `path`, if it agrees with the original, or not at all.

    Args:
        model: As it predicts; running figures of BatchNorm become constants.
        path: Replaced if it exists.
        metrics: What is known of the network, as JSON, for people.

    Returns:
        What the file holds, and how well it agrees.

    Raises:
        MissingExtra: If onnx or onnxruntime is not installed.
        Disagreement: If an output differs by more than `LIMIT` of the largest.
    """
    try:
        from dnet.nets.onnx_graph import as_graph  # noqa: PLC0415
    except ImportError as error:
        raise MissingExtra("onnx", "onnx", "a network as ONNX") from error
    model = copy.deepcopy(model).cpu().eval()
    header = json.dumps(header_of(model, metrics))
    graph = as_graph(model, metadata={_KEY: header}).SerializeToString(deterministic=True)
    exported = OnnxDeformerNet(open_session(graph), model.config)
    found = agreement(model, exported)
    check(path, found)
    write_whole(path, graph)
    return exported, found


def check(path: Path, found: Agreement) -> None:
    """Refuse a network that is not the original.

    Raises:
        Disagreement: If an output differs by more than `LIMIT` of the largest, or is NaN.
    """
    if not found.worst <= LIMIT:
        raise Disagreement(path, found.worst, LIMIT)


def load(path: Path) -> OnnxDeformerNet:
    """Return the network that an ONNX file holds, ready to predict.

    Raises:
        MissingExtra: If onnxruntime is not installed.
        BadCheckpoint: If there is no such file, or it is corrupt, or of another network.
    """
    if not path.is_file():
        raise BadCheckpoint(path, "does not exist", _HINT)
    try:
        session = open_session(path.read_bytes())
        text = session.get_modelmeta().custom_metadata_map.get(_KEY, "{}")
    except MissingExtra:
        raise
    except Exception as error:  # ONNX Runtime's errors have no other root.
        why = f"is not a whole ONNX file ({str(error).splitlines()[0]})"
        raise BadCheckpoint(path, why, _HINT) from error
    try:
        header = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise BadCheckpoint(path, f"has an unreadable header ({error})", _HINT) from error
    names = {one.name for one in session.get_inputs()}, {one.name for one in session.get_outputs()}
    if (
        not isinstance(header, dict)
        or header.get("network") != _NETWORK
        or names != ({*TABLES, GOAL}, {FEATURES, MOTION})
    ):
        raise BadCheckpoint(path, f"holds another network than {_NETWORK}", _HINT)
    return OnnxDeformerNet(session, config_of(path, header.get("config")))
