"""Stream batches of pairs from recorded episodes into a training of your own."""

import sys

import numpy as np

from dnet.datasets.loading import Division, load_samples

stream = load_samples(sys.argv[1], pairs="rest", batch=8, division=Division("training"))
for batch in stream:  # one epoch
    worth = np.mean(np.square(np.asarray(batch.motion))) * 1e6
    shapes = f"{tuple(batch.current.shape)} -> {tuple(batch.motion.shape)}"
    print(f"{shapes}: no motion is {worth:.0f} mm² off")
