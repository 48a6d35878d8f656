"""A dataset as a LeRobot dataset, version v3.0."""

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
from jaxtyping import Float32

from dnet.datasets.frame_table import SETTLED
from dnet.datasets.index import Index
from dnet.tools import lerobot_layout as layout
from dnet.tools.export_parquet import nodes_column
from dnet.tools.exported_episode import ExportedEpisode, exported_episodes, points_of_all
from dnet.tools.exported_output import Exported, finished_output
from dnet.tools.lerobot_statistics import Figures, combined_figures, episode_figures
from dnet.tools.parquet_stream import write_table, write_tables

BYTES_A_FILE = layout.FILE_MEGABYTES * 2**20
"""Of a data file in memory, before it is compressed."""
WITHOUT_FIGURES = ("nodes", "kind")
"""Ground truth is no input to normalize, and text has no mean."""


def export_lerobot(
    index: Index,
    out: Path,
    *,
    bytes_a_file: int = BYTES_A_FILE,
    on_episode: Callable[[int, int], None] = lambda _done, _total: None,
) -> Exported:
    """Write a folder that `LeRobotDataset(NAME, root=OUT)` opens.

    What policies see: `observation.cloud` (n, 3); `observation.state`, the manipulation point and
    the joints of both arms; `action`, see `motions`. These are float32, as LeRobot's own. Beside
    them, without an "observation." that would make them inputs: `grasp`, `joints` and `time` in
    float64, `kind`, and `nodes`, the ground truth. `timestamp` counts frames, `time` seconds of
    simulation. `dnet.meta` of `meta/episodes` holds the metadata of each episode as JSON.

    Args:
        index: The dataset.
        out: The folder.
        bytes_a_file: A data file ends with the episode in which it passes this.
        on_episode: Called with the number of episodes that are done and of all.

    Raises:
        NoEpisodes: If none has a frame that can be read.
        BadEpisode: If clouds differ in their number of points, or two logs hold the same episode,
            or one cannot be read any more.
        OccupiedOutput: If `out` is already there.
        Unwritten: If it cannot be written.
    """
    points = points_of_all(index)
    with finished_output(out) as part:
        book = _Book(part, bytes_a_file)
        _write_data(book, _tables(book, exported_episodes(index, on_episode)))
        _write_meta(book, points)
    return Exported(out, len(book.rows), book.frames)


def motions(episode: ExportedEpisode) -> Float32[np.ndarray, "f 3"]:
    """Return of each frame how the grasp moves until the next settled frame; at the last, not."""
    wanted = np.zeros_like(episode.grasps)
    following = None
    for number in reversed(range(len(episode))):
        if following is not None:
            wanted[number] = following - episode.grasps[number]
        if episode.kinds[number] in SETTLED:
            following = episode.grasps[number]
    return wanted.astype(np.float32)


@dataclass
class _Book:
    """What is known of the dataset so far."""

    folder: Path
    bytes_a_file: int
    files: int = 0
    """Data files that were begun."""
    frames: int = 0
    meshes: set[int] = field(default_factory=set)
    """Numbers of nodes."""
    rows: list[dict[str, Any]] = field(default_factory=list)
    """Of the table of episodes."""
    figures: list[dict[str, Figures]] = field(default_factory=list)
    """Of each episode."""


def _tables(book: _Book, episodes: Iterator[ExportedEpisode]) -> Iterator[pl.DataFrame]:
    """Turn episodes into tables of frames, and note each in the book when it is asked for."""
    for episode in episodes:
        columns = _columns(episode, len(book.rows), book.frames)
        figures = episode_figures(
            {name: values for name, values in columns.items() if name not in WITHOUT_FIGURES}
        )
        first, book.frames = book.frames, book.frames + len(episode)
        book.figures.append(figures)
        book.meshes |= {len(one) for one in episode.nodes}
        book.rows.append(
            {
                "episode_index": len(book.rows),
                "tasks": [layout.TASK],
                "length": len(episode),
                "dataset_from_index": first,
                "dataset_to_index": book.frames,
                "dnet.episode": episode.episode,
                "dnet.meta": episode.meta,
            }
        )
        yield pl.DataFrame(columns)


def _columns(episode: ExportedEpisode, number: int, first: int) -> dict[str, Any]:
    count = len(episode)
    frames = np.arange(count)
    joints = episode.joints.reshape(count, -1)
    return {
        "observation.cloud": episode.stacked_clouds(),
        "observation.state": np.hstack([episode.grasps, joints]).astype(np.float32),
        "action": motions(episode),
        "grasp": episode.grasps,
        "joints": joints,
        "nodes": nodes_column(episode.nodes),
        "time": episode.times,
        "kind": list(episode.kinds),
        "timestamp": (frames / layout.FPS).astype(np.float32),
        "frame_index": frames,
        "episode_index": np.full(count, number),
        "index": first + frames,
        "task_index": np.zeros(count, np.int64),
    }


def _write_data(book: _Book, tables: Iterator[pl.DataFrame]) -> None:
    """Write the frames, a new file where the last one has become too long."""
    ahead = next(tables, None)
    while ahead is not None:
        path = book.folder / layout.data_file(book.files)
        path.parent.mkdir(parents=True, exist_ok=True)
        file = _File(book, ahead, tables)
        write_tables(file.tables(), path)
        ahead = file.ahead
        book.files += 1


@dataclass
class _File:
    """The tables that go into one data file."""

    book: _Book
    ahead: pl.DataFrame | None
    """The table that comes next."""
    following: Iterator[pl.DataFrame]

    def tables(self) -> Iterator[pl.DataFrame]:
        size = 0
        while self.ahead is not None and size < self.book.bytes_a_file:
            table = self.ahead
            chunk, number = layout.chunk_and_number(self.book.files)
            # Of the episode that was noted last: the next is not yet asked for.
            self.book.rows[-1] |= {"data/chunk_index": chunk, "data/file_index": number}
            size += int(table.estimated_size())
            yield table
            self.ahead = next(self.following, None)


def _write_meta(book: _Book, points: int) -> None:
    folder = book.folder
    for name in (layout.EPISODES_FILE, layout.TASKS_FILE):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
    layout.write_tasks(folder / layout.TASKS_FILE)
    rows = [
        row
        | {"meta/episodes/chunk_index": 0, "meta/episodes/file_index": 0}
        | {
            f"stats/{feature}/{name}": values.tolist()
            for feature, known in figures.items()
            for name, values in known.items()
        }
        for row, figures in zip(book.rows, book.figures, strict=True)
    ]
    write_table(pl.DataFrame(rows, infer_schema_length=None), folder / layout.EPISODES_FILE)
    mesh = next(iter(book.meshes)) if len(book.meshes) == 1 else None
    info = layout.info(len(book.rows), book.frames, layout.features(points, mesh))
    figures = {
        feature: {name: values.tolist() for name, values in known.items()}
        for feature, known in combined_figures(book.figures).items()
    }
    for name, content in ((layout.INFO_FILE, info), (layout.STATISTICS_FILE, figures)):
        (folder / name).write_text(json.dumps(content, indent=4), encoding="utf-8")
