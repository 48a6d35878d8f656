"""Which episodes of a directory a network learns from, and which it is judged by."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from dnet.datasets.directory import find_episodes
from dnet.datasets.reader import EpisodeReader
from dnet.datasets.split import split
from dnet.errors import TooFew
from dnet.training.frames import settled


@dataclass(frozen=True, slots=True)
class Survey:
    """What is known of an episode without reading its clouds."""

    path: Path
    episode_id: str
    frames: int
    """Settled ones."""


@dataclass(frozen=True, slots=True)
class Division:
    """The episodes of a directory, parted by episode."""

    training: tuple[Survey, ...]
    validation: tuple[Survey, ...]
    skipped: int
    """Files with fewer than two settled frames, hence without a pair."""
    points: int
    """Points of the first cloud; all others must have as many."""


def divide(directory: Path, *, fraction: float, seed: int) -> Division:
    """Return which episodes of `directory` to learn from.

    Args:
        directory: With `.mcap` episodes.
        fraction: How much to validate on; both sides get at least one episode.
        seed: Another seed, another division.

    Raises:
        MissingPath: If there is no such directory.
        NoEpisodes: If it holds no episode.
        BadEpisode: If one of its files is not an episode.
        NotAFraction: If `fraction` is not between 0 and 1.
        TooFew: If fewer than two episodes have a pair of settled frames.
    """
    found: list[Survey] = []
    points = 0
    skipped = 0
    for path in find_episodes(directory):
        with EpisodeReader(path) as episode:
            frames = settled(episode.kinds)
            if len(frames) < 2:
                skipped += 1
                continue
            found.append(Survey(path, episode.meta.episode_id, len(frames)))
            points = points or len(episode.cloud(frames[0]))
    ids = {survey.episode_id for survey in found}
    train_ids, _ = split(sorted(ids), fraction=fraction, seed=seed)
    if len(ids) < 2:
        raise TooFew(f"number of episodes in {directory} with two settled frames", len(ids), 2)
    return Division(
        tuple(survey for survey in found if survey.episode_id in train_ids),
        tuple(survey for survey in found if survey.episode_id not in train_ids),
        skipped,
        points,
    )


def open_each(surveys: Sequence[Survey]) -> Iterator[EpisodeReader]:
    """Yield the episodes one after another, each open until the next is asked for."""
    for survey in surveys:
        with EpisodeReader(survey.path) as episode:
            yield episode
