"""What else people keep clouds in: each writes those of a dataset its own way and reads them."""

import io
import json
import os
import subprocess
import tarfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from mcap.reader import McapReader, make_reader

from dnet.datasets.clouds import Clouds
from dnet.datasets.index import Index
from dnet.datasets.point_cloud import read_point_cloud
from dnet.datasets.reader import CLOUD, EpisodeReader
from dnet.datasets.stores import join
from dnet.tools.export_lerobot import export_lerobot
from dnet.types import Cloud


class Unavailable(Exception):
    """A peer that is not installed, or does not read this."""


@dataclass(frozen=True)
class Kept:
    """Clouds that are kept in some way, and the ways to read them."""

    sequential: Callable[[], Iterator[Cloud]] | None
    random: Callable[[int], Cloud] | None
    close: Callable[[], None] = lambda: None


@dataclass(frozen=True)
class Peer:
    """A way to keep clouds."""

    name: str
    keep: Callable[[Clouds, Path], Kept]


def _ours(clouds: Clouds, _folder: Path) -> Kept:
    return Kept(lambda: (clouds[row] for row in range(len(clouds))), clouds.__getitem__)


def _memmap(clouds: Clouds, folder: Path) -> Kept:
    folder.mkdir(exist_ok=True)
    path = folder / "clouds.npy"
    shape = (len(clouds), clouds.table.points, 3)
    content = np.lib.format.open_memmap(path, "w+", np.dtype("<f4"), shape)
    for row in range(len(clouds)):
        content[row] = clouds[row]
    content.flush()
    kept = np.load(path, mmap_mode="r")
    return Kept(lambda: iter(kept), kept.__getitem__)


def _stock(clouds: Clouds, _folder: Path) -> Kept:
    """The Python reader of the MCAP project, on our files."""
    table = clouds.table
    paths = [Path(join(table.root, name)) for name in table.names]
    stamps = []
    for path in paths:
        with EpisodeReader(path) as episode:
            stamps.append((np.asarray(episode.times) * 1e9).round().astype(np.int64))

    @cache
    def opened(file: int) -> McapReader:
        return make_reader(paths[file].open("rb"))

    def sequential() -> Iterator[Cloud]:
        for file in range(len(paths)):
            for _, _, message in opened(file).iter_messages(topics=[CLOUD]):
                yield read_point_cloud(memoryview(message.data))

    def random(row: int) -> Cloud:
        file, frame = int(table.file[row]), int(table.frame[row])
        stamp = int(stamps[file][frame])
        found = opened(file).iter_messages(
            topics=[CLOUD], starting_at=stamp, ending_before=stamp + 1
        )
        return read_point_cloud(memoryview(next(iter(found))[2].data))

    return Kept(sequential, random, opened.cache_clear)


def _hdf5(clouds: Clouds, folder: Path) -> Kept:
    h5py = _installed("h5py")
    file: Any = h5py.File(folder / "clouds.h5", "w")
    shape = (len(clouds), clouds.table.points, 3)
    content = file.create_dataset("clouds", shape, "<f4")
    for row in range(len(clouds)):
        content[row] = clouds[row]
    return Kept(
        lambda: (content[row] for row in range(len(clouds))), content.__getitem__, file.close
    )


def _webdataset(clouds: Clouds, folder: Path) -> Kept:
    webdataset = _installed("webdataset")
    path = folder / "clouds.tar"
    with tarfile.open(path, "w") as tar:
        for row in range(len(clouds)):
            content = io.BytesIO()
            np.save(content, clouds[row])
            entry = tarfile.TarInfo(f"{row:08}.npy")
            entry.size = content.tell()
            content.seek(0)
            tar.addfile(entry, content)

    def sequential() -> Iterator[Cloud]:
        for sample in webdataset.WebDataset(str(path), shardshuffle=False).decode():
            yield sample["npy"]

    return Kept(sequential, None)


def lerobot_speeds(index: Index, rows: Sequence[int], folder: Path) -> tuple[float, float]:
    """Return MB and random clouds a CPU-second of LeRobot, from its own Python."""
    python = os.environ.get("DNET_PEERS")
    if not python:
        raise Unavailable("DNET_PEERS names no Python with lerobot")
    exported, chosen = folder / "lerobot", folder / "rows.json"
    export_lerobot(index, exported)
    chosen.write_text(json.dumps(rows), encoding="utf-8")
    quiet = {"HF_HOME": str(folder / "hf"), "HF_HUB_OFFLINE": "1", "OMP_NUM_THREADS": "1"}
    done = subprocess.run(
        [python, "-W", "ignore", "-m", "benchmarks.lerobot_reader", exported, chosen],
        capture_output=True,
        text=True,
        check=False,
        # From within tests/: packages of that name lie about in other Pythons.
        cwd=Path(__file__).parents[1],
        env=os.environ | quiet,
    )
    if done.returncode:
        raise Unavailable(f"{python} failed: {done.stderr.splitlines()[-1]}")
    sequential, at_random = json.loads(done.stdout.splitlines()[-1])
    return sequential, at_random


def _installed(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError as error:
        remedy = 'pip install "deformernet[peers]"'
        raise Unavailable(f"{name} is not installed ({remedy})") from error


PEERS = (
    Peer("npy memmap", _memmap),
    Peer("dnet", _ours),
    Peer("mcap, stock reader", _stock),
    Peer("h5py", _hdf5),
    Peer("WebDataset", _webdataset),
)
"""The first is the limit; the third reads the same files as the second."""
