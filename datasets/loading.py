"""From a folder or a URL of logs to batches for training, in one call."""

from dataclasses import dataclass
from typing import Literal

from dnet.datasets.batch_order import BatchOrder
from dnet.datasets.clouds import Clouds
from dnet.datasets.frame_table import FrameTable, settled_frames
from dnet.datasets.groups import GroupBatch, Groups
from dnet.datasets.index import open_index
from dnet.datasets.pairs import Pairs, any_two, from_rest, mixed
from dnet.datasets.samples import SampleBatch, Samples
from dnet.datasets.split import HELD_OUT, split, split_frames
from dnet.datasets.stream import Stream
from dnet.types import Place

PairKind = Literal["any", "rest", "mixed"]
"""`any`: all ordered pairs of frames of an episode; `rest`: from the rest shape, as the paper;
`mixed`: all from rest, and as many of any two."""


@dataclass(frozen=True, slots=True)
class Division:
    """Which part of a dataset is meant, and how it is parted."""

    side: Literal["training", "validation"] = "training"
    by: Literal["episode", "shape"] = "episode"
    """`episode`: a network is judged by unseen objects and grasps, as `dnet train` does; `shape`:
    by unseen shapes of seen episodes, as the paper does."""
    fraction: float = HELD_OUT
    """How much is for validation."""
    seed: int = 0

    def of(self, table: FrameTable) -> FrameTable:
        """Return the frames of this side.

        Raises:
            NotAFraction: If the fraction is not from 0 to 1.
        """
        first = self.side == "training"
        if self.by == "shape":
            parts = split_frames(table, fraction=self.fraction, seed=self.seed)
            return parts[0 if first else 1]
        ids = sorted(table.episodes)
        training, validation = split(ids, fraction=self.fraction, seed=self.seed)
        return table.of_episodes(set(training if first else validation))


@dataclass(frozen=True, slots=True)
class Share:
    """Which process of a training reads, and how."""

    rank: int = 0
    world: int = 1
    """How many processes train together; each gets batches of its own."""
    workers: int = 0
    """Processes that read ahead; none is fastest on local data."""
    pin: bool = False
    """Whether batches go into pinned memory, from which a GPU reads fastest."""

    def order(self, count: int, batch: int, *, seed: int) -> BatchOrder:
        """Return the order of this process; several processes get as many batches each."""
        even = self.world > 1
        return BatchOrder(count, batch, seed, rank=self.rank, world=self.world, even=even)


def load_samples(
    root: Place,
    *,
    pairs: PairKind = "any",
    batch: int = 32,
    seed: int = 0,
    division: Division | None = None,
    share: Share | None = None,
) -> Stream[SampleBatch]:
    """Return a stream of samples: current cloud, goal cloud, motion of the grasp.

    Args:
        root: Folder or URL of episodes; its index is brought up to date.
        pairs: Which frames make a sample.
        batch: Samples of a batch.
        seed: Of the order.
        division: A side of the dataset, or all of it.
        share: This process among several, which must then all have as many batches.

    Raises:
        NoEpisodes: If there is none that can be read.
        TooFew: If there are too few frames for what is asked.
        BadEpisode: If the clouds do not go together.
    """
    share = share or Share()
    clouds = Clouds(_table(root, division))
    samples = Samples(clouds, _pairs(clouds.table, pairs, seed))
    order = share.order(len(samples), batch, seed=seed)
    return Stream(samples, order, workers=share.workers, pin=share.pin)


def load_groups(
    root: Place,
    *,
    clouds: int = 5,
    groups: int = 1,
    seed: int = 0,
    division: Division | None = None,
    share: Share | None = None,
) -> Stream[GroupBatch]:
    """Return a stream of groups of clouds of one episode, for training on all pairs of them.

    Args:
        root: Folder or URL of episodes; its index is brought up to date.
        clouds: The least clouds of a group, except in an episode with fewer.
        groups: How many groups form a batch.
        seed: Of the order, and of who meets whom.
        division: A side of the dataset, or all of it.
        share: This process among several, which must then all have as many batches.

    Raises:
        NoEpisodes: If there is none that can be read.
        TooFew: If there are too few frames for what is asked.
        BadEpisode: If the clouds do not go together.
    """
    share = share or Share()
    dealt = Groups(Clouds(_table(root, division)), size=clouds, seed=seed)
    order = share.order(len(dealt), groups, seed=seed)
    return Stream(dealt, order, workers=share.workers, pin=share.pin)


def _table(root: Place, division: Division | None) -> FrameTable:
    table = settled_frames(open_index(root))
    return table if division is None else division.of(table)


def _pairs(table: FrameTable, kind: PairKind, seed: int) -> Pairs:
    if kind == "any":
        return any_two(table)
    return from_rest(table) if kind == "rest" else mixed(table, share=0.5, seed=seed)
