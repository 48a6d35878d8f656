"""An open DeformerNet: simulate, record, train, servo and play back soft-tissue manipulation."""

from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, overload

if TYPE_CHECKING:
    from dnet.nets.deformernet import DeformerNet
    from dnet.nets.onnx_network import OnnxDeformerNet

__version__ = version("deformernet")


@overload
def load(path: None = None) -> "DeformerNet": ...


@overload
def load(path: str | Path) -> "DeformerNet | OnnxDeformerNet": ...


def load(path: str | Path | None = None) -> "DeformerNet | OnnxDeformerNet":
    """Return a trained network on the CPU, ready to `predict(current, goal)`.

    Args:
        path: A run directory of `dnet train`, whose best network is taken, a `.safetensors` file,
            or a `.onnx` file of `dnet export`; the network that ships, unless given.

    Raises:
        BadCheckpoint: If there is no such file, or it is corrupt, or of another network.
        MissingExtra: If onnxruntime is needed and not installed.
    """
    # Torch takes a second to import; `dnet --help` does without.
    from dnet.training.checkpoints import load as load_network  # noqa: PLC0415
    from dnet.training.onnx_files import SUFFIX  # noqa: PLC0415
    from dnet.training.onnx_files import load as load_onnx  # noqa: PLC0415
    from dnet.weights import DEFORMERNET  # noqa: PLC0415

    file = DEFORMERNET if path is None else Path(path)
    return load_onnx(file) if file.suffix == SUFFIX else load_network(file)
