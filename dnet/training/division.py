"""Which frames a network learns from, and the two kinds of frames that it is judged by."""

from dataclasses import dataclass

import numpy as np
import polars as pl

from dnet.datasets.frame_table import FrameTable, settled_frames
from dnet.datasets.index import Index
from dnet.datasets.split import split, split_frames
from dnet.errors import BadEpisode, TooFew


@dataclass(frozen=True, slots=True)
class Division:
    """The settled frames of a dataset, parted by episode and then by shape."""

    all: FrameTable
    training: FrameTable
    unseen_shapes: FrameTable
    """Other shapes of the episodes that are trained on, as the paper tests; with their rest
    shapes, from which its pairs begin. No pair can be made of them if the episodes are short."""
    unseen_episodes: FrameTable
    """Episodes of other objects, poses and grasps: what a servo loop meets."""
    skipped: int
    """Files with fewer than two settled frames, hence without a pair."""

    @property
    def parts(self) -> dict[str, FrameTable]:
        """The three parts, by the names that people read."""
        return {
            "training": self.training,
            "unseen shapes": self.unseen_shapes,
            "unseen episodes": self.unseen_episodes,
        }


def divide(index: Index, *, fraction: float, seed: int, episodes: int | None = None) -> Division:
    """Return which frames of a dataset to learn from.

    A side depends on hashes of episode and shape alone, so that episodes recorded later leave
    the earlier ones where they are.

    Args:
        index: Of the dataset.
        fraction: How many episodes to hold out, and how many shapes of the others; at least one
            episode is held out and one learned from.
        seed: Another seed, another division.
        episodes: How many of the episodes that are not held out to learn from, the first ones by
            id; None for all. What is held out stays the same.

    Raises:
        BadEpisode: If one of the files cannot be read, clouds differ in their number of points,
            or two files hold one episode.
        NotAFraction: If `fraction` is not between 0 and 1.
        TooFew: If fewer than two episodes have a pair of settled frames.
    """
    for name, note in index.broken().select("name", "note").iter_rows():
        raise BadEpisode(index.path(name), note, "remove it, or record it again")
    frames = settled_frames(index)
    paired = frames.where((frames.lengths > 1)[frames.file])
    ids = paired.episodes_seen
    if len(ids) < 2:
        raise TooFew(f"number of episodes in {index.root} with two settled frames", len(ids), 2)
    train_ids, held_out = split(ids, fraction=fraction, seed=seed)
    train_ids = train_ids[:episodes]
    training, unseen = split_frames(
        paired.of_episodes(set(train_ids)), fraction=fraction, seed=seed
    )
    return Division(
        paired,
        training,
        unseen,
        paired.of_episodes(set(held_out)),
        index.files.filter(pl.col("note") == "").height - len(ids),
    )


def pairs_of(table: FrameTable) -> int:
    """Return how many ordered pairs of frames of one episode there are."""
    return int((table.lengths * (table.lengths - 1)).sum())


def thinned(table: FrameTable, most: int) -> FrameTable:
    """Return a table of at most about `most` of the frames.

    They are taken evenly from each episode, the first one, the rest shape, among them; two or
    more of each, so that there are pairs: of very many episodes, some are left out instead.
    """
    files, counts = np.unique(table.file, return_counts=True)
    step = -(-2 * len(files) // most)
    each = max(2, most // len(files[::step]))
    chosen = np.zeros(len(table), dtype=bool)
    for start, count in list(zip(np.cumsum(counts) - counts, counts, strict=True))[::step]:
        chosen[start + np.linspace(0, count - 1, min(each, count)).astype(int)] = True
    return table.where(chosen)
