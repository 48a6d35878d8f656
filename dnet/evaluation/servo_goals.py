"""Which shapes of a dataset a servo loop is to reach."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dnet.datasets.reader import EpisodeReader
from dnet.errors import MissingPath, NoEpisodes, NoSuchEpisode, TooFew


def draw_goals(folder: Path, episodes: Sequence[str], *, count: int, seed: int) -> list[str]:
    """Return settled shapes of episodes, as `EPISODE:FRAME`, none of them twice.

    Each episode in turn gives one, in a random order, so that scenes are as different as can be.

    Args:
        folder: Where the episodes are.
        episodes: Ids of those to choose from; none for all.
        count: How many shapes.
        seed: Of the choice.

    Raises:
        MissingPath, NoEpisodes: If there is no such directory, or no episode in it.
        NoSuchEpisode: If an episode is not there.
        TooFew: If all of the episodes together have fewer shapes.
    """
    if not folder.is_dir():
        raise MissingPath(folder, "directory", "record one with `dnet record`")
    there = {path.stem: path for path in sorted(folder.glob("*.mcap"))}
    if not there:
        raise NoEpisodes(folder)
    for name in episodes:
        if name not in there:
            raise NoSuchEpisode(folder, name, list(there))
    random = np.random.default_rng(seed)
    shapes: list[list[str]] = []
    for name in random.permutation(sorted(episodes or there)).tolist():
        with EpisodeReader(there[name]) as episode:
            settled = [n for n, kind in enumerate(episode.kinds) if kind == "shape"]
        drawn = random.permutation(settled).tolist()
        shapes.append([f"{there[name]}:{number}" for number in drawn])
    longest = max(len(frames) for frames in shapes)
    in_turn = [frames[turn] for turn in range(longest) for frames in shapes if turn < len(frames)]
    if len(in_turn) < count:
        raise TooFew(f"settled shapes in {folder}", len(in_turn), count)
    return in_turn[:count]
