import io
import struct
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dnet.errors import BadCloudFile, HugeCloud
from dnet.perception.cloud_claims import LONGEST_HEAD, MOST_BYTES, MOST_POINTS, check_claims
from dnet.perception.cloud_file import read_cloud

PCD = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT {0}\nWIDTH {1}\nHEIGHT 1\n"
PCD += "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {1}\nDATA {2}\n"
HUGE = 10**12
PLY = "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nend_header\n"


def npy(shape: tuple[int, ...]) -> bytes:
    file = io.BytesIO()
    described: dict[str, Any] = {"descr": "<f4", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, described)
    return file.getvalue()


def packed(points: int, size: int) -> bytes:
    """Return a .pcd that says that so many bytes are packed in four."""
    head = PCD.format("1 1 1", points, "binary_compressed").encode()
    return head + struct.pack("<II", 4, size) + bytes(4)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.npy", npy((100, 3))),
        ("a.ply", PLY.format("binary_little_endian", 1000).encode()),
        ("a.ply", PLY.format("ascii", 1000).encode()),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 8\n"),
        ("a.ply", b"ply\n" * LONGEST_HEAD),
        ("a.pcd", PCD.format("1 1 1", 1000, "binary").encode()),
        ("a.pcd", PCD.format("1 1 1", 1000, "ascii").encode()),
        ("a.pcd", PCD.format("1 1 1000", 8, "binary").encode()),
        ("a.pcd", PCD.format("1 1 1", 1000, "binary").replace("POINTS 1000\n", "").encode()),
        ("a.pcd", PCD.format("1 1 1", "1_0", "binary").encode()),
        ("a.pcd", packed(8, 400_000_000)),
    ],
)
def test_a_file_that_claims_more_than_it_has_is_refused(
    tmp_path: Path, name: str, content: bytes
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"claims to hold|has no line|must be"):
        check_claims(path)
    with pytest.raises(BadCloudFile):
        read_cloud(path, points=8)


@pytest.mark.parametrize(
    ("name", "content", "why"),
    [
        ("a.npy", npy((HUGE, 3)), f"{HUGE} points, at most {MOST_POINTS}"),
        ("a.npy", npy((3, HUGE)), f"{12 * HUGE} bytes, at most {MOST_BYTES}"),
        ("a.ply", PLY.format("ascii", HUGE).encode(), f"{HUGE} points, at most {MOST_POINTS}"),
        ("a.pcd", PCD.format("1 1 1", HUGE, "binary").encode(), f"{HUGE} points, at most"),
        ("a.pcd", PCD.format("1 1 1", HUGE, "ascii").encode(), f"{HUGE} points, at most"),
        ("a.pcd", PCD.format(f"1 1 {HUGE}", 8, "binary").encode(), "bytes, at most"),
        ("a.pcd", packed(8, 2**32 - 1), f"{2**32 - 1} bytes, at most {MOST_BYTES}"),
    ],
)
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
        file.truncate(2**40)
    with pytest.raises(HugeCloud, match=f"{2**40} bytes, at most {MOST_BYTES} are read"):
        read_cloud(path, points=64)


def test_the_picture_that_a_ply_names_is_not_opened(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    rows = "".join(f"{number} {number % 3} 0\n" for number in range(8))
    head = "ply\nformat ascii 1.0\ncomment TextureFile ../../etc/passwd\nelement vertex 8\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz") + "end_header\n"
    path = tmp_path / "a.ply"
    path.write_text(head + rows)
    assert len(read_cloud(path, points=8)) == 8
    assert "unable to load image" not in caplog.text
