"""Small datasets of made-up episodes, some of them behind a URL."""

from pathlib import Path
from typing import Any

import fsspec

from dnet.datasets.frame_table import FrameTable, settled_frames
from dnet.datasets.index import open_index
from tests.recorders import rollout

LENGTHS = (4, 1, 6)
"""Settled frames of each episode."""


def write_dataset(folder: Path, lengths: tuple[int, ...] = LENGTHS) -> Path:
    """Write episodes of so many frames each."""
    folder.mkdir(exist_ok=True)
    for index, length in enumerate(lengths):
        rollout.write(folder / f"episode-{index}.mcap", rollout.frames(length, seed=index))
    return folder


def upload(folder: Path, name: str) -> str:
    """Copy the logs of a folder into the memory of this process, behind a URL."""
    files: Any = fsspec.filesystem("memory")
    if files.exists(f"/{name}"):
        files.rm(f"/{name}", recursive=True)
    for path in sorted(folder.glob("*.mcap")):
        files.pipe_file(f"/{name}/{path.name}", path.read_bytes())
    return f"memory://{name}"


def table_of(root: Path | str) -> FrameTable:
    """Index a dataset and return its settled frames."""
    return settled_frames(open_index(root))
