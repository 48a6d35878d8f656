"""Whether data go to and come from other programs."""

import io
import tempfile
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np


def read_clouds() -> str:
    """Write a cloud as .ply and .pcd, and read both as `dnet servo --goal` does."""
    from dnet.perception.cloud_file import read_cloud  # noqa: PLC0415

    trimesh: Any = import_module("trimesh")
    pypcd4: Any = import_module("pypcd4")
    cloud = np.random.default_rng(0).uniform(-0.05, 0.05, (64, 3)).astype(np.float32)
    with tempfile.TemporaryDirectory() as folder:
        ply, pcd = Path(folder) / "a.ply", Path(folder) / "a.pcd"
        trimesh.PointCloud(cloud).export(str(ply))
        pypcd4.PointCloud.from_xyz_points(cloud).save(pcd)
        for path in (ply, pcd):
            found = read_cloud(path, points=64)
            if sorted(found.tolist()) != sorted(cloud.tolist()):
                raise RuntimeError(f"a {path.suffix} reads otherwise than it was written")
    return ".ply and .pcd written and read"


def write_hdf5() -> str:
    """Write an array as HDF5 and read it again."""
    h5py: Any = import_module("h5py")

    numbers = np.arange(8)
    with h5py.File(io.BytesIO(), "w") as file:
        file["numbers"] = numbers
        if not np.array_equal(file["numbers"][()], numbers):
            raise RuntimeError("an array reads otherwise than it was written")
    return f"h5py {h5py.__version__} wrote and read an array"


def register() -> str:
    """Register a cloud with itself, moved."""
    from dnet.evaluation.registration import coherent  # noqa: PLC0415

    cloud = np.random.default_rng(0).uniform(-0.05, 0.05, (24, 3)).astype(np.float32)
    found = coherent(cloud, cloud + np.float32(0.01))
    return f"pycpd carried {len(found.initial)} points"
