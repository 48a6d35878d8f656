"""A dataset as one HDF5 file, a group an episode, its arrays contiguous."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from dnet.datasets.index import Index
from dnet.datasets.reader import SCHEMA_VERSION
from dnet.errors import MissingExtra, Unwritten
from dnet.tools.exported_episode import exported_episodes
from dnet.tools.exported_output import Exported, finished_output


def export_hdf5(
    index: Index,
    out: Path,
    *,
    on_episode: Callable[[int, int], None] = lambda _done, _total: None,
) -> Exported:
    """Write a file with a group of each episode, called as its log is.

    A group has the arrays of `dnet.tools.export_npz.export_npz` as contiguous datasets, so that a
    frame is read without the others; texts are UTF-8. The attribute `schema_version` of the file
    is that of the logs.

    Args:
        index: The dataset.
        out: The file.
        on_episode: Called with the number of episodes that are done and of all.

    Raises:
        MissingExtra: If h5py is not installed.
        NoEpisodes: If none has a frame that can be read.
        BadEpisode: If two files hold the same episode, or one cannot be read any more.
        OccupiedOutput: If `out` is already there.
        Unwritten: If it cannot be written.
    """
    h5py = _h5py()
    episodes = frames = 0
    with finished_output(out) as part, h5py.File(_with_room(part, index), "w") as file:
        file.attrs["schema_version"] = SCHEMA_VERSION
        for episode in exported_episodes(index, on_episode):
            group = file.create_group(episode.name)
            for name, values in episode.arrays().items():
                group.create_dataset(name, data=_storable(values, h5py))
            episodes += 1
            frames += len(episode)
    return Exported(out, episodes, frames)


def _with_room(part: Path, index: Index) -> Path:
    """Refuse a disk that may fill up: HDF5 does not survive that, the process would crash.

    The logs hold all that is exported, and more.
    """
    need, free = int(index.files["bytes"].sum()), shutil.disk_usage(part.parent).free
    if need > free:
        why = f"{free / 1e6:.1f} MB are free, the export may take {need / 1e6:.1f} MB"
        raise Unwritten(part.parent, why)
    return part


def _h5py() -> Any:
    try:
        import h5py  # noqa: PLC0415  # an extra
    except ImportError as error:
        raise MissingExtra("h5py", "exchange", "writing HDF5") from error
    return h5py


def _storable(values: np.ndarray, h5py: Any) -> np.ndarray:
    """Return text as what HDF5 knows, and all else as it is."""
    return values.astype(h5py.string_dtype()) if values.dtype.kind == "U" else values
