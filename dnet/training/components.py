"""Fits the network of Hu et al. to the frames that it is to learn from, before it learns."""

import numpy as np

from dnet.nets.hu import HuNet
from dnet.training.frames import Frames


def find_components(network: HuNet, frames: Frames) -> None:
    """Find the principal components of frames, of all of them.

    A network that has principal components already, since it has been trained, keeps them: its
    layers have learned what they mean.

    Args:
        network: With the weights that it is to begin with.
        frames: To learn from.
    """
    if network.fitted:
        return
    described = frames.prepared(np.arange(len(frames.table)))
    network.fit(described.features.numpy(), frames.table.file.astype(np.int64))
