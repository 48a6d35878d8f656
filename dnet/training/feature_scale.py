"""Fits a keypoint network to the frames that it is to learn from, before it learns."""

import numpy as np
import torch

from dnet.nets.keypoints import KeypointNet
from dnet.training.division import thinned
from dnet.training.frames import Frames

CLOUDS = 512
"""Frames that features are scaled by, evenly from all episodes."""
_AT_ONCE = 32


def scale_features(network: KeypointNet, frames: Frames) -> None:
    """Scale what the encoder of a network says of frames to mean 0 and variance 1.

    A network whose features are scaled already, since it has been trained, stays as it is.

    Args:
        network: With the encoder that it is to have.
        frames: To learn from.
    """
    if network.scaled:
        return
    samplings, device = frames.tables.samplings, network.middle.device
    taken = Frames.of(thinned(frames.table, CLOUDS), frames.config, samplings=samplings)
    rows = np.arange(len(taken.table))
    batches = np.split(rows, range(_AT_ONCE, len(rows), _AT_ONCE))
    network.scale(torch.cat([network.encode(taken.prepared(some).to(device)) for some in batches]))
