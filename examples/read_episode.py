"""Read an episode: its clouds, and how far the grasp moved."""

import sys

import numpy as np

from dnet.datasets.reader import EpisodeReader

with EpisodeReader(sys.argv[1]) as episode:
    for number, kind in enumerate(episode.kinds):
        cloud = episode.cloud(number)  # (2048, 3), metres, world frame
        moved = np.linalg.norm(episode.grasps[number] - episode.grasps[0])
        print(f"{number} {kind}: {len(cloud)} points, grasp moved {1e3 * moved:.1f} mm")
