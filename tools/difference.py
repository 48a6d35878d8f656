"""How two episodes, or two datasets, differ."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from filecmp import cmp
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from jaxtyping import Float

from dnet.datasets.index import Index
from dnet.datasets.reader import EpisodeReader
from dnet.tools.difference_messages import differing_messages
from dnet.types import Frame

FRAME_COLUMNS = {
    "frame": pl.Int64,
    "what": pl.String,
    "cloud_mm": pl.Float64,
    "grasp_mm": pl.Float64,
    "nodes_mm": pl.Float64,
    "joints": pl.Float64,
}
"""Number of a frame of both; what differs besides numbers; and the largest distance between
points of one row, of the grasps, between nodes of one number (null where there are not as many),
and between joint positions in radians or metres."""
FILE_COLUMNS = {"file": pl.String, "difference": pl.String}
PACKED = "packed in another way, with the same content"
"""The one difference of files that is none of episodes."""


@dataclass(frozen=True, slots=True)
class EpisodeDifference:
    """How one episode differs from another."""

    same_bytes: bool
    facts: Mapping[str, tuple[Any, Any]]
    """What is known of them as a whole and differs, by dotted name, of the one and of the other."""
    frames: pl.DataFrame
    """A row for each frame that differs; columns as in `FRAME_COLUMNS`."""
    messages: Mapping[str, int] = field(default_factory=dict)
    """Topics and metadata of which a message differs, each with the number of the first: also what
    frames are not made of, such as goals, steps, images and lines."""

    @property
    def same(self) -> bool:
        """Whether they say the same, perhaps in files that are packed in another way."""
        return not (self.facts or self.frames.height or self.messages)


def compare_episodes(one: Path, other: Path) -> EpisodeDifference:
    """Return how an episode differs from another.

    Raises:
        MissingPath: If one of them does not exist.
        BadEpisode: If one of them cannot be read.
        BrokenRecord: If one of them is damaged where its index does not lead.
    """
    with EpisodeReader(one) as first, EpisodeReader(other) as second:
        if cmp(one, other, shallow=False):
            return EpisodeDifference(True, {}, pl.DataFrame(schema=FRAME_COLUMNS))
        facts = _unequal(_facts(first), _facts(second))
        rows = [
            row
            for index in range(min(len(first), len(second)))
            if (row := _compare_frames(index, first.frame(index), second.frame(index))) is not None
        ]
    frames = pl.DataFrame(rows, schema=FRAME_COLUMNS, orient="row")
    return EpisodeDifference(False, facts, frames, differing_messages(one, other))


def compare_datasets(one: Index, other: Index) -> pl.DataFrame:
    """Return a row for each file that only one of two datasets has, or that differs."""
    both = one.files.select("name", "sha256", "note").join(
        other.files.select("name", "sha256", "note"), on="name", how="full", coalesce=True
    )
    rows = [
        (row["name"], why)
        for row in both.sort("name").iter_rows(named=True)
        if (why := _file_difference(row, one, other))
    ]
    return pl.DataFrame(rows, schema=FILE_COLUMNS, orient="row")


def _file_difference(row: Mapping[str, Any], one: Index, other: Index) -> str:
    if row["note"] is None or row["note_right"] is None:
        return f"only in {(other if row['note'] is None else one).root}"
    paths = Path(one.path(row["name"])), Path(other.path(row["name"]))
    broken = [index for index, note in ((one, row["note"]), (other, row["note_right"])) if note]
    if broken and cmp(*paths, shallow=False):
        return ""
    if broken:
        return f"cannot be read in {' and '.join(str(index.root) for index in broken)}"
    if row["sha256"] == row["sha256_right"]:
        return ""
    return first_difference(compare_episodes(*paths))


def first_difference(found: EpisodeDifference) -> str:
    """Return in a few words how two episodes differ; nothing for the same bytes."""
    if found.same_bytes:
        return ""
    if found.frames.height:
        row = found.frames.row(0, named=True)
        parts = [row["what"]] if row["what"] else []
        parts += [
            f"{name.removesuffix('_mm')} by {row[name]:.3g}{' mm' if name.endswith('mm') else ''}"
            for name in ("cloud_mm", "grasp_mm", "nodes_mm", "joints")
            if row[name]
        ]
        return f"{found.frames.height} frames, the first is {row['frame']}: {', '.join(parts)}"
    if found.facts:
        name, (one, other) = next(iter(found.facts.items()))
        return f"{name}: {one} and {other}"
    for name, number in found.messages.items():
        return f"{name}: from message {number} on"
    return PACKED


def _facts(episode: EpisodeReader) -> dict[str, Any]:
    meta = asdict(episode.meta)
    attached = {name: episode.attachment(name) for name in episode.attachments}
    return {
        "frames": len(episode),
        "finished": episode.finished,
        **_flat("", meta),
        **_flat("result", episode.result or {}),
        **{f"attachment {name}": sha256(content).hexdigest() for name, content in attached.items()},
    }


def _flat(name: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, Mapping):
        return {name: value}
    flat: dict[str, Any] = {}
    for key, inner in value.items():
        flat |= _flat(f"{name}.{key}" if name else str(key), inner)
    return flat


def _unequal(one: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, tuple[Any, Any]]:
    names = [*one, *(name for name in other if name not in one)]
    pairs = {name: (one.get(name), other.get(name)) for name in names}
    return {name: pair for name, pair in pairs.items() if pair[0] != pair[1]}


def _compare_frames(index: int, one: Frame, other: Frame) -> tuple[Any, ...] | None:
    what = []
    if one.kind != other.kind:
        what.append(f"kind {one.kind} and {other.kind}")
    if one.time != other.time:
        what.append(f"time {one.time} and {other.time}")
    for name in ("cloud", "nodes"):
        counts = len(getattr(one, name)), len(getattr(other, name))
        if counts[0] != counts[1]:
            what.append(f"{name} of {counts[0]} and {counts[1]} points")
    joints = max(
        float(np.abs(mine - yours).max())
        for mine, yours in zip(one.joints, other.joints, strict=True)
    )
    distances = (
        _farthest(one.cloud, other.cloud),
        _farthest(one.grasp[None], other.grasp[None]),
        _farthest(one.nodes, other.nodes),
        joints,
    )
    if not what and not any(distances):
        return None
    return (index, "; ".join(what), *distances)


def _farthest(one: Float[np.ndarray, "n 3"], other: Float[np.ndarray, "m 3"]) -> float | None:
    """Return the largest distance of a row from the same row, in mm; None for other counts."""
    if one.shape != other.shape:
        return None
    if not len(one):
        return 0.0
    steps = one.astype(np.float64) - other
    return 1e3 * float(np.linalg.norm(steps, axis=1).max())
