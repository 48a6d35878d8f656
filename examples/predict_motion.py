"""Ask the network that ships how the grasp must move from one shape of an episode to another."""

import sys

import dnet
from dnet.datasets.reader import EpisodeReader

network = dnet.load()
with EpisodeReader(sys.argv[1]) as episode:
    motion = network.predict(episode.cloud(0), episode.cloud(1))
    true = episode.grasps[1] - episode.grasps[0]
print(f"predicted {motion * 1e3} mm, true {true * 1e3} mm")
