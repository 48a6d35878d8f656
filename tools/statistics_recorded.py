"""What the figures of a recording are computed from: a row an episode, a row a frame."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from sys import float_info
from typing import Any

import numpy as np
import polars as pl

from dnet.datasets.directory import find_unfinished
from dnet.datasets.index import INDEX, Index, open_index
from dnet.datasets.messages import UNREADABLE, read_scene
from dnet.errors import BadIndex, NoEpisodes
from dnet.files.sizes import parse_json
from dnet.geometry.pose import rotation_z
from dnet.tools.statistics_oddities import Oddities, oddities
from dnet.types import Scene

MOST_REJECTED = 2**40
"""Draws of one episode; what says of more, says nothing."""

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
_REJECTED = {"episode": pl.String, "reason": pl.String, "count": pl.Int64}


@dataclass(frozen=True, slots=True)
class Recorded:
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
    oddities: Oddities
    unfinished: int
    """Files of recordings that run or were interrupted."""
    broken: int
    """Files that cannot be read."""


def read_recorded(
    directory: Path, *, on_episode: Callable[[int, int], None] = lambda _done, _total: None
) -> Recorded:
    """Return all that is known of the episodes of `directory`, of clouds how long they are.

    Args:
        directory: With `.mcap` episodes; its index is brought up to date.
        on_episode: Called with the number of files read and of all that must be.

    Raises:
        MissingPath: If there is no such directory.
        NoEpisodes: If it holds no finished episode.
        BadIndex: If its index, which is not its own, says of one what cannot be.
    """
    index = open_index(directory, on_file=on_episode)
    readable = index.files.filter(pl.col("note") == "")
    finished = readable.filter("finished")
    unfinished = len(find_unfinished(directory)) + readable.height - finished.height
    broken = index.files.height - readable.height
    if not finished.height:
        raise NoEpisodes(
            directory,
            f"holds no finished episode, but {unfinished} unfinished and {broken} broken files "
            f"(`dnet inspect ls {directory}` says why)",
        )
    rows = list(finished.iter_rows(named=True))
    results = [_result(index, row) for row in rows]
    rejected = [
        one for row, result in zip(rows, results, strict=True) for one in _rejected(row, result)
    ]
    return Recorded(
        directory,
        pl.DataFrame(
            [_row(index, row, result) for row, result in zip(rows, results, strict=True)],
            schema=_EPISODES,
            orient="row",
        ),
        _frames(index.frames.join(finished.select("name"), on="name", maintain_order="left")),
        pl.DataFrame(rejected, schema=_REJECTED, orient="row"),
        oddities(index),
        unfinished,
        broken,
    )


def _row(index: Index, file: Mapping[str, Any], result: Mapping[str, Any]) -> tuple[Any, ...]:
    scene = _scene(index, file)
    offset = np.array(scene.manipulation_point) - np.array([*scene.position, 0.0])
    deviation = _mapping(result, "deviation_mm")
    return (
        file["name"],
        file["bytes"],
        file["seconds"],
        file["object"],
        *(1e3 * file[f"size_{axis}"] for axis in "xyz"),
        file["young"],
        *(1e3 * rotation_z(scene.yaw).T @ offset).tolist(),
        _mapping(result, "rejected") is not None,
        None if deviation is None else _number(deviation.get("mean")),
        None if deviation is None else _number(deviation.get("worst")),
    )


def _frames(frames: pl.DataFrame) -> pl.DataFrame:
    return frames.select(
        pl.col("name").alias("episode"),
        pl.col("kind").cast(pl.String),
        pl.col("points").cast(pl.Int64),
        *((1e3 * pl.col(f"motion_{axis}")).alias(axis) for axis in "xyz"),
    )


def _scene(index: Index, file: Mapping[str, Any]) -> Scene:
    try:
        return read_scene(file["scene"])
    except UNREADABLE as error:
        raise BadIndex(index.path(INDEX), file["name"], "scene", file["scene"]) from error


def _result(index: Index, file: Mapping[str, Any]) -> Mapping[str, Any]:
    try:
        return dict(parse_json(file["result"]))
    except (ValueError, TypeError) as error:
        raise BadIndex(index.path(INDEX), file["name"], "result", file["result"]) from error


def _rejected(file: Mapping[str, Any], result: Mapping[str, Any]) -> list[tuple[str, str, int]]:
    reasons = _mapping(result, "rejected") or {}
    return [
        (file["name"], reason, count)
        for reason, count in reasons.items()
        if isinstance(count, int) and abs(count) < MOST_REJECTED
    ]


def _mapping(result: Mapping[str, Any], key: str) -> Mapping[str, Any] | None:
    """Return a part of the result, None if an older recording lacks it."""
    value = result.get(key)
    return value if isinstance(value, Mapping) else None


def _number(value: object) -> float | None:
    # A whole number in JSON may be larger than any float.
    if isinstance(value, int | float) and abs(value) <= float_info.max:
        return float(value)
    return None
