"""A dataset as .npz, one file an episode, which numpy alone reads."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from dnet.datasets.index import Index
from dnet.tools.exported_episode import exported_episodes
from dnet.tools.exported_output import Exported, finished_output


def export_npz(
    index: Index,
    out: Path,
    *,
    on_episode: Callable[[int, int], None] = lambda _done, _total: None,
) -> Exported:
    """Write a folder with a `NAME.npz` of each episode.

    Its arrays: `clouds` (f, n, 3) float32, or `cloud_000` and so on, (n, 3) each, where they
    differ in their number of points; `nodes` in the same way; `grasps` (f, 3), `joints` (f, 2, 6)
    of the holding and the moving arm, and `times` (f,), all float64; `kinds` (f,), text; `meta`,
    a text of JSON. None of them is pickled. `dnet inspect import` reads them back.

    Args:
        index: The dataset.
        out: The folder.
        on_episode: Called with the number of episodes that are done and of all.

    Raises:
        NoEpisodes: If none has a frame that can be read.
        BadEpisode: If two files hold the same episode, or one cannot be read any more.
        OccupiedOutput: If `out` is already there.
        Unwritten: If it cannot be written.
    """
    episodes = frames = 0
    with finished_output(out) as part:
        part.mkdir()
        for episode in exported_episodes(index, on_episode):
            np.savez(part / f"{episode.name}.npz", **episode.arrays())
            episodes += 1
            frames += len(episode)
    return Exported(out, episodes, frames)
