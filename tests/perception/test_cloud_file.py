"""Clouds of other programs are read as they are, and refused where they are none."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dnet.errors import BadCloudFile, MissingPath
from dnet.perception.cloud_file import read_cloud

PYPCD4: Any = pytest.importorskip("pypcd4")
TRIMESH: Any = pytest.importorskip("trimesh")
CLOUD = np.random.default_rng(0).uniform(-0.05, 0.05, (300, 3)).astype(np.float32)


def write(path: Path, cloud: np.ndarray, encoding: str) -> Path:
    if path.suffix == ".npy":
        np.save(path, cloud)
    elif path.suffix == ".ply":
        path.write_bytes(
            TRIMESH.exchange.ply.export_ply(TRIMESH.PointCloud(cloud), encoding=encoding)
        )
    else:
        names = {"ascii": PYPCD4.Encoding.ASCII, "binary": PYPCD4.Encoding.BINARY}
        PYPCD4.PointCloud.from_xyz_points(cloud).save(path, encoding=names[encoding])
    return path


def as_set(cloud: np.ndarray) -> set[tuple[float, ...]]:
    return {tuple(np.round(point, 5).tolist()) for point in cloud}


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
@pytest.mark.parametrize("suffix", [".npy", ".ply", ".pcd", ".PLY"])
def test_every_point_comes_back(tmp_path: Path, suffix: str, encoding: str) -> None:
    path = write(tmp_path / f"a{suffix.lower()}", CLOUD, encoding)
    path = path.rename(tmp_path / f"b{suffix}")
    found = read_cloud(path, points=len(CLOUD))
    assert found.dtype == np.float32
    assert as_set(found) == as_set(CLOUD)


def test_a_larger_cloud_is_thinned_and_what_is_no_number_left_out(tmp_path: Path) -> None:
    spoilt = CLOUD.copy()
    spoilt[::10] = np.nan
    found = read_cloud(write(tmp_path / "a.npy", spoilt, ""), points=64)
    assert found.shape == (64, 3)
    assert as_set(found) <= as_set(CLOUD)


def test_doubles_will_do(tmp_path: Path) -> None:
    path = write(tmp_path / "a.npy", CLOUD.astype(np.float64), "")
    assert as_set(read_cloud(path, points=300)) == as_set(CLOUD)


@pytest.mark.parametrize("suffix", [".npy", ".ply", ".pcd"])
@pytest.mark.parametrize("content", [b"", b"Dear diary, \x00\xff" * 50])
def test_what_is_no_cloud_is_refused(tmp_path: Path, suffix: str, content: bytes) -> None:
    path = tmp_path / f"a{suffix}"
    path.write_bytes(content)
    with pytest.raises(BadCloudFile, match=str(path)):
        read_cloud(path, points=10)


def test_other_shapes_and_too_few_points_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "a.npy", CLOUD[:, :2], "")
    with pytest.raises(BadCloudFile, match=r"array of \(300, 2\)"):
        read_cloud(path, points=10)
    path = write(tmp_path / "b.npy", CLOUD, "")
    with pytest.raises(BadCloudFile, match="has 300 finite points, the network takes 2048"):
        read_cloud(path, points=2048)


def test_a_pickle_is_not_run(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.array([{}, {}], dtype=object), allow_pickle=True)
    with pytest.raises(BadCloudFile):
        read_cloud(tmp_path / "a.npy", points=1)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(MissingPath, match=r"gone\.ply does not exist"):
        read_cloud(tmp_path / "gone.ply", points=10)
