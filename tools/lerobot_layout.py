"""What a LeRobot dataset of version v3.0 says of itself: its files, its features, its index."""

import json
from collections.abc import Mapping
from io import BytesIO
from pathlib import Path
from typing import Any

import polars as pl

VERSION = "v3.0"
FILES_A_CHUNK = 1000
"""Files of one folder `chunk-000`."""
FILE_MEGABYTES = 100
"""A data file ends where it passes this; as LeRobot's own do."""
FPS = 1
"""Shapes settle when they do, and LeRobot knows fixed rates alone: its time counts frames."""
TASK = "Move the manipulation point so that the object takes its next settled shape."

_ARM_JOINTS = ("yaw", "pitch", "insertion", "roll", "wrist_pitch", "wrist_yaw")
JOINTS = [f"{side}_{joint}" for side in ("left", "right") for joint in _ARM_JOINTS]
GRASP = ["grasp_x", "grasp_y", "grasp_z"]


def data_file(number: int) -> Path:
    """Return where the data file of a number is in the folder of the dataset."""
    return Path("data", *_chunk_and_file(number))


EPISODES_FILE = Path("meta", "episodes", "chunk-000", "file-000.parquet")
TASKS_FILE = Path("meta", "tasks.parquet")
INFO_FILE = Path("meta", "info.json")
STATISTICS_FILE = Path("meta", "stats.json")


def features(points: int, nodes: int | None) -> dict[str, dict[str, Any]]:
    """Return type and shape of each column of the data, by name.

    Args:
        points: Of every cloud.
        nodes: Of every mesh; None if meshes differ.
    """
    return {
        "observation.cloud": _feature("float32", [points, 3]),
        "observation.state": _feature("float32", [15], [*GRASP, *JOINTS]),
        "action": _feature("float32", [3], ["motion_x", "motion_y", "motion_z"]),
        "grasp": _feature("float64", [3], GRASP),
        "joints": _feature("float64", [12], JOINTS),
        "nodes": _feature("float32", [nodes, 3]),
        "time": _feature("float64", [1]),
        "kind": _feature("string", [1]),
        "timestamp": _feature("float32", [1]),
        "frame_index": _feature("int64", [1]),
        "episode_index": _feature("int64", [1]),
        "index": _feature("int64", [1]),
        "task_index": _feature("int64", [1]),
    }


def info(episodes: int, frames: int, described: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of `meta/info.json`.

    Args:
        episodes: How many there are.
        frames: How many all of them have.
        described: The features.
    """
    return {
        "codebase_version": VERSION,
        "robot_type": "two PSM arms",
        "total_episodes": episodes,
        "total_frames": frames,
        "total_tasks": 1,
        "chunks_size": FILES_A_CHUNK,
        "data_files_size_in_mb": FILE_MEGABYTES,
        "video_files_size_in_mb": FILE_MEGABYTES,
        "fps": FPS,
        "splits": {"train": f"0:{episodes}"},
        "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": None,
        "features": dict(described),
    }


def write_tasks(path: Path) -> None:
    """Write the table of tasks, whose rows LeRobot looks up by their text.

    It reads them by pandas, which takes a column for the names of the rows if the file says so.
    """
    text, number = ("task", "unicode", "object"), ("task_index", "int64", "int64")
    columns = [
        {
            "name": name,
            "field_name": name,
            "pandas_type": kind,
            "numpy_type": stored,
            "metadata": None,
        }
        for name, kind, stored in (number, text)
    ]
    pandas = {
        "index_columns": ["task"],
        "column_indexes": [],
        "columns": columns,
        "creator": {"library": "dnet", "version": VERSION},
        "pandas_version": "2.0.0",
    }
    content = BytesIO()
    table = pl.DataFrame({"task_index": [0], "task": [TASK]})
    table.write_parquet(content, metadata={"pandas": json.dumps(pandas)})
    # Where a file holds the schema of Arrow too, Arrow takes what pandas wants from there alone,
    # and polars leaves it out: a key of another name, as long, is not looked at.
    path.write_bytes(content.getvalue().replace(b"ARROW:schema", b"polars:arrow"))


def chunk_and_number(number: int) -> tuple[int, int]:
    """Return which chunk a data file is in, and which file of it."""
    return divmod(number, FILES_A_CHUNK)


def _chunk_and_file(number: int) -> tuple[str, str]:
    chunk, file = chunk_and_number(number)
    return f"chunk-{chunk:03d}", f"file-{file:03d}.parquet"


def _feature(dtype: str, shape: list[int | None], names: list[str] | None = None) -> dict[str, Any]:
    return {"dtype": dtype, "shape": shape, "names": names}
