"""What the index says of one file: a row for it, and a row for each of its frames."""

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np
import polars as pl

from dnet.datasets.reader import EpisodeReader
from dnet.datasets.sources import Fetched, MappedFile, Source, fetch
from dnet.datasets.stores import file_system, is_url, join
from dnet.errors import BadEpisode
from dnet.types import Cloud, FrameKind, Place

AXES = ("x", "y", "z")
KINDS = pl.Enum(get_args(FrameKind))

FILE_COLUMNS: dict[str, Any] = {
    "name": pl.String,
    "version": pl.String,
    "bytes": pl.Int64,
    "sha256": pl.String,
    "note": pl.String,
    "episode": pl.String,
    "seed": pl.Int64,
    "pair": pl.Int64,
    "frames": pl.Int64,
    "shapes": pl.Int64,
    "seconds": pl.Float64,
    "finished": pl.Boolean,
    "object": pl.String,
    "size_x": pl.Float64,
    "size_y": pl.Float64,
    "size_z": pl.Float64,
    "young": pl.Float64,
    "scene": pl.String,
    "result": pl.String,
}
"""Of the table of files: name, version (changes when the file does), bytes and SHA-256; note (why
nothing can be read of it, else empty); id, seed and pair of the episode; its frames, settled
shapes and seconds of simulation; whether the recording ended by itself; shape, size (m) and
Young's modulus (Pa) of the object; what the episode starts from and what the recording said of
itself at its end, both as JSON."""

FRAME_COLUMNS: dict[str, Any] = {
    "name": pl.String,
    "episode": pl.String,
    "frame": pl.Int32,
    "kind": KINDS,
    "time": pl.Float64,
    **{f"grasp_{axis}": pl.Float64 for axis in AXES},
    **{f"motion_{axis}": pl.Float64 for axis in AXES},
    "points": pl.Int32,
    "content": pl.UInt64,
    "chunk": pl.Int64,
    "length": pl.Int64,
    "message": pl.Int64,
    "data": pl.Int64,
}
"""Of the table of frames: file and id of the episode; number, kind and time (s) of the frame; the
manipulation point and its motion since frame 0 (m); points of the cloud, and a hash of them: equal
clouds have equal ones; and where the cloud lies, as `dnet.datasets.reader.CloudPlace` says."""

LARGEST_FETCHED = 4 * 2**30
"""Bytes of a log in a store that is still fetched as a whole to be indexed."""

_UNKNOWN = dict.fromkeys(FILE_COLUMNS) | {"frames": 0, "shapes": 0, "finished": False}


@dataclass(frozen=True, slots=True)
class FileRows:
    """What the index says of one file."""

    file: dict[str, Any]
    frames: pl.DataFrame


def read_rows(root: Place, name: str, *, version: str, size: int) -> FileRows:
    """Read all of a file, and return what the index says of it.

    A file that is no episode, or a damaged one, gets a row with a note and no frames.

    Args:
        root: The folder or URL that the file is in.
        name: The file.
        version: What changes when the file does.
        size: Its bytes.

    Raises:
        Unfetched: If a store does not answer.
    """
    place = join(root, name)
    known = _UNKNOWN | {"name": name, "version": version, "bytes": size, "note": ""}
    try:
        source = _source(place, size)
        digest = hashlib.sha256(source.view(0, len(source))).hexdigest()
        with EpisodeReader(place, source=source) as episode:
            # First what can fail: half an episode must not count.
            frames = _frame_rows(episode, name)
            return FileRows(known | {"sha256": digest} | _episode_row(episode), frames)
    except BadEpisode as error:
        why = str(error).removeprefix(f"{place} ").split(";")[0]
        return FileRows(known | {"note": why}, pl.DataFrame(schema=FRAME_COLUMNS))


def _source(place: Place, size: int) -> Source:
    if not is_url(place):
        return MappedFile(Path(place))
    if size > LARGEST_FETCHED:
        why = f"has {size} bytes, at most {LARGEST_FETCHED} are fetched at once"
        raise BadEpisode(place, why, "index it in a folder of this machine")
    # All of it is needed: one request is quicker than one for each block.
    files, path = file_system(str(place), doing="reading")
    return Fetched(fetch(files, path, name=str(place), start=0, stop=size))


def _episode_row(episode: EpisodeReader) -> dict[str, Any]:
    meta, times = episode.meta, episode.times
    tissue = meta.scene.tissue
    return {
        "episode": meta.episode_id,
        "seed": meta.seed,
        "pair": meta.index,
        "frames": len(episode),
        "shapes": episode.kinds.count("shape"),
        "seconds": float(times[-1] - times[0]) if len(episode) else 0.0,
        "finished": episode.finished,
        "object": tissue.shape,
        "size_x": tissue.size[0],
        "size_y": tissue.size[1],
        "size_z": tissue.size[2],
        "young": tissue.young,
        "scene": json.dumps(asdict(meta.scene)),
        "result": None if episode.result is None else json.dumps(episode.result),
    }


def _frame_rows(episode: EpisodeReader, name: str) -> pl.DataFrame:
    count, grasps = len(episode), episode.grasps
    if not np.isfinite(grasps).all():
        raise BadEpisode(episode.path, "has a grasp of NaN or infinity", "record it again")
    moved = grasps - grasps[:1]
    places = [episode.cloud_place(index) for index in range(count)]
    clouds = [episode.cloud(index) for index in range(count)]
    columns = {
        "name": [name] * count,
        "episode": [episode.meta.episode_id] * count,
        "frame": np.arange(count, dtype=np.int32),
        "kind": list(episode.kinds),
        "time": episode.times,
        **{f"grasp_{axis}": grasps[:, column] for column, axis in enumerate(AXES)},
        **{f"motion_{axis}": moved[:, column] for column, axis in enumerate(AXES)},
        "points": [len(cloud) for cloud in clouds],
        "content": [_hash(cloud) for cloud in clouds],
        "chunk": [place.chunk for place in places],
        "length": [place.length for place in places],
        "message": [place.message for place in places],
        "data": [place.data for place in places],
    }
    return pl.DataFrame(columns, schema=FRAME_COLUMNS)


def _hash(cloud: Cloud) -> int:
    """Return 64 bits: among a million clouds two that differ share them once in 40 million."""
    digest = hashlib.blake2b(cloud.tobytes(), digest_size=8).digest()
    return int.from_bytes(digest, "little")
