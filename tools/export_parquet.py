"""A dataset as Parquet, one row a frame."""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import polars as pl

from dnet.datasets.index import Index
from dnet.tools.exported_episode import ExportedEpisode, exported_episodes, points_of_all
from dnet.tools.exported_output import Exported, finished_output
from dnet.tools.parquet_stream import write_table, write_tables
from dnet.types import Nodes

NODES = pl.List(pl.Array(pl.Float32, 3))
"""A list, not an array: meshes differ from object to object."""


def export_parquet(
    index: Index,
    out: Path,
    *,
    per_episode: bool = False,
    on_episode: Callable[[int, int], None] = lambda _done, _total: None,
) -> Exported:
    """Write one file of all episodes, or a folder with a `NAME.parquet` of each.

    Its columns: `episode`, the id; `frame`, from 0; `kind`; `time`; `cloud`, a fixed array
    (n, 3) of float32; `grasp` (3,), `joints_left` and `joints_right` (6,), fixed arrays of
    float64; `nodes`, a list of arrays (3,) of float32; `meta`, JSON, in the row of frame 0 alone.
    A group has 64 rows. One episode at a time is held in memory.

    Args:
        index: The dataset.
        out: The file, or the folder.
        per_episode: Whether to write a folder.
        on_episode: Called with the number of episodes that are done and of all.

    Raises:
        NoEpisodes: If none has a frame that can be read.
        BadEpisode: If clouds of one file would differ in their number of points, or two logs hold
            the same episode, or one cannot be read any more.
        OccupiedOutput: If `out` is already there.
        Unwritten: If it cannot be written.
    """
    if not per_episode:
        points_of_all(index)
    episodes = frames = 0

    def tables() -> Iterator[tuple[str, pl.DataFrame]]:
        nonlocal episodes, frames
        for episode in exported_episodes(index, on_episode):
            episodes += 1
            frames += len(episode)
            yield episode.name, frame_table(episode)

    with finished_output(out) as part:
        if per_episode:
            part.mkdir()
            for name, table in tables():
                write_table(table, part / f"{name}.parquet")
        else:
            write_tables((table for _, table in tables()), part)
    return Exported(out, episodes, frames)


def frame_table(episode: ExportedEpisode) -> pl.DataFrame:
    """Return one row a frame, with the columns that `export_parquet` writes.

    Raises:
        BadEpisode: If its clouds differ in their number of points.
    """
    count = len(episode)
    left, right = np.moveaxis(episode.joints, 1, 0)
    return pl.DataFrame(
        {
            "episode": [episode.episode] * count,
            "frame": np.arange(count, dtype=np.int32),
            "kind": list(episode.kinds),
            "time": episode.times,
            "cloud": episode.stacked_clouds(),
            "grasp": episode.grasps,
            "joints_left": np.ascontiguousarray(left),
            "joints_right": np.ascontiguousarray(right),
            "nodes": nodes_column(episode.nodes),
            "meta": pl.Series([episode.meta, *[None] * (count - 1)], dtype=pl.String),
        }
    )


def nodes_column(nodes: tuple[Nodes, ...]) -> pl.Series:
    """Return a list of points for each frame; frames may differ in their number."""
    return pl.concat([pl.Series("nodes", one[None]).cast(NODES) for one in nodes])
