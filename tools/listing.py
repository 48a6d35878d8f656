"""Tables of what was recorded: the episodes of a directory, the frames of an episode."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from dnet.datasets.directory import find_unfinished
from dnet.datasets.index import Index, open_index
from dnet.datasets.reader import EpisodeReader
from dnet.datasets.stores import is_url
from dnet.errors import BadEpisode, NoEpisodes
from dnet.geometry.chamfer import chamfer
from dnet.types import Place

EPISODE_COLUMNS = {
    "episode": pl.String,
    "frames": pl.Int64,
    "shapes": pl.Int64,
    "points": pl.Int64,
    "seconds": pl.Float64,
    "MB": pl.Float64,
    "finished": pl.Boolean,
    "note": pl.String,
}
FRAME_COLUMNS = {
    "frame": pl.Int64,
    "kind": pl.String,
    "time": pl.Float64,
    "x": pl.Float64,
    "y": pl.Float64,
    "z": pl.Float64,
    "motion_mm": pl.Float64,
    "chamfer_mm": pl.Float64,
    "points": pl.Int64,
}


@dataclass(frozen=True, slots=True)
class EpisodeDescription:
    """What `dnet inspect info` tells of one episode."""

    summary: Mapping[str, Any]
    """What is known of it as a whole, by name."""
    frames: pl.DataFrame
    """One row a frame; motion and Chamfer distance are from the rest frame."""


def list_episodes(
    root: Place, *, on_file: Callable[[int, int], None] = lambda _done, _total: None
) -> pl.DataFrame:
    """Return one row an episode, those that are unfinished or broken with a note.

    Columns: episode, frames, shapes (settled after a motion), points (least of any frame),
    seconds (of simulation), MB, finished, note.

    Args:
        root: A folder or URL; its index is brought up to date.
        on_file: Called with the number of files read and of all that must be.

    Raises:
        MissingPath: If there is no such folder.
        NoEpisodes: If it holds neither an episode nor an unfinished one.
        Unfetched: If a store does not answer.
    """
    unfinished = [] if is_url(root) else find_unfinished(Path(root))
    rows = {path.name: _unfinished_row(path) for path in unfinished}
    try:
        rows |= _indexed_rows(open_index(root, on_file=on_file))
    except NoEpisodes:
        if not unfinished:
            raise
    ordered = [rows[name] for name in sorted(rows)]
    return pl.DataFrame(ordered, schema=EPISODE_COLUMNS, orient="row")


def describe_episode(path: Place) -> EpisodeDescription:
    """Return the summary and the frames of one episode.

    Raises:
        MissingPath: If there is no such file.
        BadEpisode: If it is not an episode, or is cut off, or is damaged.
    """
    with EpisodeReader(path) as episode:
        rows = []
        rest = episode.cloud(0) if len(episode) else None
        for index, kind in enumerate(episode.kinds):
            cloud = episode.cloud(index)
            grasp = episode.grasps[index]
            comparable = rest is not None and len(rest) and len(cloud)
            rows.append(
                (
                    index,
                    kind,
                    float(episode.times[index]),
                    *grasp.tolist(),
                    1e3 * float(np.linalg.norm(grasp - episode.grasps[0])),
                    1e3 * chamfer(cloud, rest) if comparable and rest is not None else None,
                    len(cloud),
                )
            )
        frames = pl.DataFrame(rows, schema=FRAME_COLUMNS, orient="row")
        return EpisodeDescription(summary=_summary(episode), frames=frames)


def _summary(episode: EpisodeReader) -> dict[str, Any]:
    meta = episode.meta
    goal = episode.goal()
    summary: dict[str, Any] = {
        "episode": meta.episode_id,
        "seed": meta.seed,
        "index": meta.index,
        **_flat("scene", asdict(meta.scene)),
        **_flat("settings", meta.settings),
        "finished": episode.finished,
        "attachments": ", ".join(episode.attachments),
    }
    if goal is not None:
        summary |= {"goal": f"{len(goal)} points", "steps": len(episode.steps())}
    if episode.result is not None:
        summary |= _flat("result", episode.result)
    return summary


def _flat(name: str, values: Mapping[str, Any], *, depth: int = 3) -> dict[str, Any]:
    """Return nested values by dotted names, down to `depth`."""
    flat: dict[str, Any] = {}
    for key, value in values.items():
        if isinstance(value, Mapping) and value and depth > 1:
            flat |= _flat(f"{name}.{key}", value, depth=depth - 1)
        else:
            flat[f"{name}.{key}"] = value
    return flat


def _indexed_rows(index: Index) -> dict[str, tuple[Any, ...]]:
    """Return the row of each file, by name."""
    least = index.frames.group_by("name").agg(pl.col("points").min())
    files = index.files.join(least, on="name", how="left").with_columns(
        pl.when(pl.col("note") != "")
        .then("note")
        .when(pl.col("finished"))
        .then(pl.lit(""))
        .otherwise(pl.lit("interrupted"))
        .alias("note")
    )
    return {
        row["name"]: (
            row["episode"] or row["name"].removesuffix(".mcap"),
            *(
                (None,) * 4
                if row["episode"] is None
                else (row["frames"], row["shapes"], row["points"] or 0, row["seconds"])
            ),
            row["bytes"] / 1e6,
            row["finished"],
            row["note"],
        )
        for row in files.iter_rows(named=True)
    }


def _unfinished_row(path: Path) -> tuple[Any, ...]:
    megabytes = path.stat().st_size / 1e6
    try:
        with EpisodeReader(path) as episode:
            points = [len(episode.cloud(index)) for index in range(len(episode))]
            return (
                episode.meta.episode_id,
                len(episode),
                episode.kinds.count("shape"),
                min(points, default=0),
                float(episode.times[-1] - episode.times[0]) if len(episode) else 0.0,
                megabytes,
                episode.finished,
                "interrupted, whole frames readable",
            )
    except BadEpisode as error:
        name = path.name.removesuffix(".mcap.part")
        why = str(error).removeprefix(f"{path} ").split(";")[0]
        return (name, None, None, None, None, megabytes, False, f"unfinished, {why}")
