"""What the figures of a recording are computed from: a row an episode, a row a frame."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from dnet.datasets.directory import find_episodes, find_unfinished
from dnet.datasets.reader import EpisodeReader
from dnet.errors import BadEpisode, NoEpisodes
from dnet.geometry.pose import rotation_z

_EPISODES = {
    "episode": pl.String,
    "bytes": pl.Int64,
    "seconds": pl.Float64,
    "shape": pl.String,
    "size_x": pl.Float64,
    "size_y": pl.Float64,
    "size_z": pl.Float64,
    "young": pl.Float64,
    "x": pl.Float64,
    "y": pl.Float64,
    "z": pl.Float64,
    "counted": pl.Boolean,
    "deviation_mean": pl.Float64,
    "deviation_worst": pl.Float64,
}
_FRAMES = {
    "episode": pl.String,
    "kind": pl.String,
    "points": pl.Int64,
    "x": pl.Float64,
    "y": pl.Float64,
    "z": pl.Float64,
}
_REJECTED = {"episode": pl.String, "reason": pl.String, "count": pl.Int64}


@dataclass(frozen=True, slots=True)
class Index:
    """The finished episodes of a directory without their clouds. Lengths in millimetres."""

    directory: Path
    episodes: pl.DataFrame
    """episode (file name), bytes, seconds (of simulation), shape, size_x, size_y, size_z and young
    (pascals) of the tissue, x, y, z (manipulation point in the object's own frame: its centre on
    the table, before the turn), counted (whether it says what was rejected), deviation_mean,
    deviation_worst (null if it does not say)."""
    frames: pl.DataFrame
    """episode, kind, points (of the cloud), x, y, z (of the manipulation point from where it was
    in the first frame, along the world's axes)."""
    rejected: pl.DataFrame
    """episode, reason, count."""
    unfinished: int
    """Files of recordings that run or were interrupted."""
    broken: int
    """Files that cannot be read."""


def read_index(
    directory: Path, *, on_episode: Callable[[int, int], None] = lambda _done, _total: None
) -> Index:
    """Read all that is known of the episodes of `directory`, of clouds how long they are.

    Args:
        directory: With `.mcap` episodes.
        on_episode: Called with the number of files read and of all files.

    Raises:
        MissingPath: If there is no such directory.
        NoEpisodes: If it holds no finished episode.
    """
    paths = find_episodes(directory)
    unfinished, broken = len(find_unfinished(directory)), 0
    episodes: list[tuple[Any, ...]] = []
    frames: list[pl.DataFrame] = []
    rejected: list[tuple[str, str, int]] = []
    for number, path in enumerate(paths, start=1):
        try:
            with EpisodeReader(path) as episode:
                if episode.finished:
                    # First what can fail: half an episode must not count.
                    frames.append(_frames(episode, path.name))
                    episodes.append(_row(episode, path))
                    rejected += _rejected(episode, path.name)
                else:
                    unfinished += 1
        except BadEpisode:
            broken += 1
        on_episode(number, len(paths))
    if not episodes:
        raise NoEpisodes(
            directory,
            f"holds no finished episode, but {unfinished} unfinished and {broken} broken files "
            f"(`dnet inspect ls {directory}` says why)",
        )
    return Index(
        directory,
        pl.DataFrame(episodes, schema=_EPISODES, orient="row"),
        pl.concat(frames),
        pl.DataFrame(rejected, schema=_REJECTED, orient="row"),
        unfinished,
        broken,
    )


def _row(episode: EpisodeReader, path: Path) -> tuple[Any, ...]:
    scene = episode.meta.scene
    offset = np.array(scene.manipulation_point) - np.array([*scene.position, 0.0])
    deviation = _mapping(episode, "deviation_mm")
    return (
        path.name,
        path.stat().st_size,
        float(episode.times[-1] - episode.times[0]) if len(episode) else 0.0,
        scene.tissue.shape,
        *(1e3 * edge for edge in scene.tissue.size),
        scene.tissue.young,
        *(1e3 * rotation_z(scene.yaw).T @ offset).tolist(),
        _mapping(episode, "rejected") is not None,
        None if deviation is None else _number(deviation.get("mean")),
        None if deviation is None else _number(deviation.get("worst")),
    )


def _frames(episode: EpisodeReader, name: str) -> pl.DataFrame:
    grasps = episode.grasps
    if not np.isfinite(grasps).all():
        raise BadEpisode(episode.path, "has a grasp of NaN or infinity", "record it again")
    moved = 1e3 * (grasps - grasps[:1])
    columns = {
        "episode": [name] * len(episode),
        "kind": list(episode.kinds),
        "points": [len(episode.cloud(index)) for index in range(len(episode))],
        **{axis: moved[:, column] for column, axis in enumerate("xyz")},
    }
    return pl.DataFrame(columns, schema=_FRAMES)


def _rejected(episode: EpisodeReader, name: str) -> list[tuple[str, str, int]]:
    reasons = _mapping(episode, "rejected") or {}
    return [(name, reason, count) for reason, count in reasons.items() if isinstance(count, int)]


def _mapping(episode: EpisodeReader, key: str) -> Mapping[str, Any] | None:
    """Return a part of the result, None if an older recording lacks it."""
    value = (episode.result or {}).get(key)
    return value if isinstance(value, Mapping) else None


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None
