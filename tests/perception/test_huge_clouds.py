"""A cloud that says that it is enormous is refused before anything is made of it."""

import tracemalloc
import zipfile
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest

from dnet.errors import BadArrays, HugeCloud
from dnet.perception.cloud_file import read_cloud
from dnet.perception.huge_clouds import MOST_BYTES, MOST_POINTS
from dnet.tools import imported_arrays

HUGE = 10**12


def npy(shape: tuple[int, ...]) -> bytes:
    content = BytesIO()
    described = {"descr": "<f4", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(content, described)
    return content.getvalue()


def pcd(points: int, *, size: int = 4, data: str = "binary") -> bytes:
    return (
        f"VERSION .7\nFIELDS x y z\nSIZE {size} 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH {points}\n"
        f"HEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {points}\nDATA {data}\n"
    ).encode() + b"\xff" * 8


PLY = f"ply\nformat binary_little_endian 1.0\nelement vertex {HUGE}\nproperty float x\nend_header\n"
CLAIMS = [
    ("a.npy", npy((HUGE, 3)), f"{HUGE} points, at most {MOST_POINTS}"),
    ("a.npy", npy((3, HUGE)), f"{12 * HUGE} bytes, at most {MOST_BYTES}"),
    ("a.ply", PLY.encode(), f"{HUGE} points, at most {MOST_POINTS}"),
    ("a.pcd", pcd(HUGE), f"{HUGE} points, at most {MOST_POINTS}"),
    ("a.pcd", pcd(10, size=HUGE), "bytes, at most"),
    ("a.pcd", pcd(10, data="binary_compressed"), f"{2**32 - 1} bytes, at most {MOST_BYTES}"),
]


@pytest.mark.parametrize(("name", "content", "why"), CLAIMS)
def test_a_file_that_says_it_is_enormous_is_refused_with_value_and_limit(
    tmp_path: Path, name: str, content: bytes, why: str
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    tracemalloc.start()
    try:
        with pytest.raises(HugeCloud, match=why):
            read_cloud(path, points=64)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 2**20


def test_a_file_that_is_enormous_is_refused_whatever_it_says(tmp_path: Path) -> None:
    path = tmp_path / "a.npy"
    path.write_bytes(npy((100, 3)))
    with path.open("r+b") as file:
        file.truncate(MOST_BYTES + 1)
    with pytest.raises(HugeCloud, match=f"{MOST_BYTES + 1} bytes, at most {MOST_BYTES}"):
        read_cloud(path, points=64)


def test_arrays_that_inflate_beyond_the_limit_are_not_unpacked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(imported_arrays, "LARGEST_ARRAYS", 10**6)
    with zipfile.ZipFile(tmp_path / "a.npz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("clouds.npy", npy((1, 10**6, 3)) + bytes(12 * 10**6))
    with pytest.raises(BadArrays, match="bytes when unpacked, at most"):
        imported_arrays.read_arrays(tmp_path / "a.npz")
