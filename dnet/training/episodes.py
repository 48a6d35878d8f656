"""Which episodes of a directory a network learns from, and which it is judged by."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import polars as pl

from dnet.datasets.frame_table import SETTLED
from dnet.datasets.index import Index
from dnet.datasets.reader import EpisodeReader
from dnet.datasets.split import split
from dnet.errors import BadEpisode, TooFew
from dnet.types import Place


@dataclass(frozen=True, slots=True)
class Survey:
    """What is known of an episode without reading its clouds."""

    path: Place
    episode_id: str
    frames: int
    """Settled ones."""
    digest: str
    """SHA-256 of the file."""


@dataclass(frozen=True, slots=True)
class Division:
    """The episodes of a directory, parted by episode."""

    training: tuple[Survey, ...]
    validation: tuple[Survey, ...]
    skipped: int
    """Files with fewer than two settled frames, hence without a pair."""
    points: int
    """Points of the first cloud; all others must have as many."""


def divide(index: Index, *, fraction: float, seed: int) -> Division:
    """Return which episodes of a dataset to learn from.

    Args:
        index: Of the dataset.
        fraction: How much to validate on; both sides get at least one episode.
        seed: Another seed, another division.

    Raises:
        BadEpisode: If one of the files cannot be read.
        NotAFraction: If `fraction` is not between 0 and 1.
        TooFew: If fewer than two episodes have a pair of settled frames.
    """
    for name, note in index.broken().select("name", "note").iter_rows():
        raise BadEpisode(index.path(name), note, "remove it, or record it again")
    settled = index.frames.filter(pl.col("kind").is_in(SETTLED))
    counted = settled.group_by("name").agg(pl.len().alias("settled"), pl.col("points").first())
    paired = index.files.join(counted.filter(pl.col("settled") > 1), on="name").sort("name")
    ids = paired["episode"].unique().sort().to_list()
    train_ids, _ = split(ids, fraction=fraction, seed=seed)
    if len(ids) < 2:
        raise TooFew(f"number of episodes in {index.root} with two settled frames", len(ids), 2)
    surveys = [
        Survey(index.path(name), episode, count, digest)
        for name, episode, count, digest in paired.select(
            "name", "episode", "settled", "sha256"
        ).iter_rows()
    ]
    return Division(
        tuple(survey for survey in surveys if survey.episode_id in train_ids),
        tuple(survey for survey in surveys if survey.episode_id not in train_ids),
        index.files.height - paired.height,
        int(paired["points"][0]),
    )


def open_each(surveys: Sequence[Survey]) -> Iterator[EpisodeReader]:
    """Yield the episodes one after another, each open until the next is asked for."""
    for survey in surveys:
        with EpisodeReader(survey.path) as episode:
            yield episode
