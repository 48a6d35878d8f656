"""Clouds in files of other programs: .npy, .ply and .pcd.

Small pure-Python readers do the work, trimesh (MIT) for .ply and pypcd4 (BSD) for .pcd: both read
ASCII and binary files. Open3D reads them too, but is 400 MB, and plyfile is under the GPL.
"""

from collections.abc import Callable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from dnet.errors import BadCloudFile, HugeCloud, MissingExtra, MissingPath
from dnet.geometry.sampling import farthest_points
from dnet.perception.cloud_claims import check_claims
from dnet.types import Cloud

EXTRA = "clouds"


def read_cloud(path: Path, *, points: int) -> Cloud:
    """Return the cloud of a file, in metres in the world frame, in farthest-point order.

    Points that are not numbers, as depth cameras write them, are left out.

    Args:
        path: A file whose name ends in one of `READERS`.
        points: How many points to keep.

    Raises:
        MissingPath: If there is no such file.
        BadCloudFile: If it is no cloud, or has too few points.
        HugeCloud: If it has too many to be read, or says so.
        MissingExtra: If the package that reads it is not installed.
    """
    if not path.is_file():
        raise MissingPath(path, "cloud", "give a .npy, .ply or .pcd file")
    read = READERS[path.suffix.lower()]
    try:
        check_claims(path)
        found = np.asarray(read(path))
    except (MissingExtra, HugeCloud, OSError):
        raise
    # A reader of somebody else's raises what it likes on a file that is none.
    except Exception as error:
        raise BadCloudFile(path, f"cannot be read ({str(error)[:200]})") from error
    if found.ndim != 2 or found.shape[1] != 3 or not np.issubdtype(found.dtype, np.number):
        raise BadCloudFile(path, f"holds an array of {found.shape}, {found.dtype}; not (n, 3)")
    cloud = np.ascontiguousarray(found, dtype=np.float32)
    cloud = cloud[np.isfinite(cloud).all(axis=1)]
    if len(cloud) < points:
        raise BadCloudFile(path, f"has {len(cloud)} finite points, the network takes {points}")
    return farthest_points(cloud, points)


def _read_npy(path: Path) -> Any:
    return np.load(path, allow_pickle=False)


def _read_ply(path: Path) -> Any:
    trimesh = _package("trimesh", path)
    # From an open file, of which trimesh does not know where it lies: a .ply may name a picture.
    with path.open("rb") as file:
        return trimesh.load(file, file_type="ply", process=False, skip_materials=True).vertices


def _read_pcd(path: Path) -> Any:
    return _package("pypcd4", path).PointCloud.from_path(path).numpy(("x", "y", "z"))


def _package(name: str, path: Path) -> Any:
    try:
        return import_module(name)
    except ImportError as error:
        raise MissingExtra(name, EXTRA, f"reading {path.name}") from error


READERS: Mapping[str, Callable[[Path], Any]] = {
    ".npy": _read_npy,
    ".ply": _read_ply,
    ".pcd": _read_pcd,
}
"""By suffix of the file."""
