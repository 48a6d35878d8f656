"""An open DeformerNet: simulate, record, train, servo and play back soft-tissue manipulation."""

from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dnet.nets.deformernet import DeformerNet

__version__ = version("deformernet")


def load(path: str | Path | None = None) -> "DeformerNet":
    """Return a trained network on the CPU, ready to `predict(current, goal)`.

    Args:
        path: A run directory of `dnet train`, whose best network is taken, or a `.safetensors`
            file; the network that ships, unless given.

    Raises:
        BadCheckpoint: If there is no such file, or it is corrupt, or of another network.
    """
    # Torch takes a second to import; `dnet --help` does without.
    from dnet.training.checkpoints import load as load_network  # noqa: PLC0415
    from dnet.weights import DEFORMERNET  # noqa: PLC0415

    return load_network(DEFORMERNET if path is None else Path(path))
