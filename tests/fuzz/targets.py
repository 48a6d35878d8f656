"""What a fuzzer feeds: each reads one kind of file as dnet does, and may raise DnetError alone."""

import json
import os
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from dnet.datasets.clouds import Clouds
from dnet.datasets.frame_table import settled_frames
from dnet.datasets.index import INDEX, open_index
from dnet.datasets.index_file import pack_index, sealed, unpack_index
from dnet.datasets.index_rows import FILE_COLUMNS, read_rows
from dnet.datasets.index_trust import believable
from dnet.datasets.reader import EpisodeReader
from dnet.datasets.table_cache import TableCache, cache_folder
from dnet.errors import DnetError
from dnet.perception.cloud_file import READERS, read_cloud
from dnet.recorders.robot_description import read_urdf
from dnet.recording.folder_store import FolderStore
from dnet.recording.manifest import MANIFEST, read_manifest
from dnet.tools.imported_arrays import read_arrays
from dnet.tools.repair import repair
from dnet.tools.statistics import statistics
from dnet.tools.statistics_recorded import read_recorded
from dnet.tools.validate_episode import check_episode
from dnet.training import checkpoints
from dnet.training.run import CONFIG, read_config

CORPUS = Path(__file__).parent / "corpus"
LOG = CORPUS / "episode" / "plain.mcap"
"""The log that an index is of."""
SUFFIXES = tuple(sorted(READERS))

Target = Callable[[bytes, Path], None]
"""Reads bytes; may use the folder, which stays from one call to the next."""


def episode(content: bytes, folder: Path) -> None:
    """Read all of an episode, and make rows of the index of it."""
    path = _written(content, folder / "episode.mcap")
    with EpisodeReader(path) as reader:
        for index in range(len(reader)):
            reader.frame(index)
            reader.transforms(index)
            reader.cloud_place(index)
        for read in (reader.camera, reader.target, reader.steps, reader.lines):
            read()
        for name in reader.attachments:
            reader.attachment(name)
    rows = read_rows(folder, path.name, version="", size=len(content))
    pack_index(pl.DataFrame([rows.file], schema=FILE_COLUMNS, orient="row"), rows.frames)


def repairing(content: bytes, folder: Path) -> None:
    """Validate an episode, and save what is whole of it."""
    path = _written(content, folder / "broken.mcap")
    check_episode(path)
    saved = folder / "saved"
    try:
        repair(path, saved)
    finally:
        for left in saved.glob("*"):
            left.unlink()


def index(content: bytes, folder: Path) -> None:
    """Open a dataset whose index is not its own; read figures, clouds and tables through it."""
    root = folder / "indexed"
    if not root.exists():
        indexed(root)
    # Under a head with the right checksum: a mutation would fail at it, and go no further.
    _written(sealed(content), root / INDEX)
    with suppress(DnetError):
        statistics(read_recorded(root), None)
    table = settled_frames(open_index(root))
    clouds = Clouds(table)
    try:
        for row in range(min(len(table), 4)):
            clouds[row].sum()
        clouds.stack(np.arange(min(len(table), 4)))
    finally:
        clouds.close()
    cache = TableCache(cache_folder(root), "fuzz", "1")
    for digest in table.digests[:4]:
        cache.find(digest, np.dtype("f4"))


def tables(content: bytes, _folder: Path) -> None:
    """Read the tables of an index alone, which is many times quicker; one refusal, a ValueError."""
    with suppress(ValueError):
        believable(*unpack_index(sealed(content), most=9))


def checkpoint(content: bytes, folder: Path) -> None:
    """Load a network of whatever kind."""
    path = _written(content, folder / "network.safetensors")
    for load in (checkpoints.load_any, checkpoints.read_metrics, checkpoints.read_tensors):
        with suppress(DnetError):
            load(path)


def goal(content: bytes, folder: Path) -> None:
    """Read a cloud; the first byte says in which format."""
    suffix = SUFFIXES[content[0] % len(SUFFIXES)] if content else SUFFIXES[0]
    read_cloud(_written(content[1:], folder / f"goal{suffix}"), points=8)


def urdf(content: bytes, _folder: Path) -> None:
    """Look through the description of a robot; its one refusal is a ValueError."""
    with suppress(ValueError):
        read_urdf(content)


def arrays(content: bytes, folder: Path) -> None:
    """Read the arrays that an episode can be made of."""
    read_arrays(_written(content, folder / "arrays.npz"))


def settings(content: bytes, folder: Path) -> None:
    """Read a manifest, and the config of a run."""
    _written(content, folder / MANIFEST)
    with suppress(DnetError):
        read_manifest(FolderStore(folder))
    _written(content, folder / CONFIG)
    read_config(folder)


TARGETS: Mapping[str, Target] = {
    "episode": episode,
    "repair": repairing,
    "index": index,
    "tables": tables,
    "checkpoint": checkpoint,
    "goal": goal,
    "urdf": urdf,
    "arrays": arrays,
    "settings": settings,
}
"""By name; most have a folder in the corpus of that name."""
_CORPORA = {"repair": "episode", "tables": "index"}


def seeds_of(name: str) -> Path:
    """Return the folder of a target's corpus."""
    return CORPUS / _CORPORA.get(name, name)


def indexed(root: Path) -> None:
    """Make a dataset of one log, which is the same whenever it is made."""
    root.mkdir(parents=True)
    path = root / LOG.name
    path.write_bytes(LOG.read_bytes())
    os.utime(path, ns=(0, 0))


def as_json(content: Any) -> bytes:
    """Return the bytes of a JSON file."""
    return json.dumps(content).encode()


def _written(content: bytes, path: Path) -> Path:
    path.write_bytes(content)
    return path
