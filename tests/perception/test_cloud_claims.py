import io
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dnet.errors import BadCloudFile, HugeCloud
from dnet.perception.cloud_claims import LARGEST_CLOUD_FILE, LONGEST_HEAD, check_claims
from dnet.perception.cloud_file import read_cloud

PCD = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT {0}\nWIDTH {1}\nHEIGHT 1\n"
PCD += "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {1}\nDATA {2}\n"
PLY = "ply\nformat {} 1.0\nelement vertex {}\nproperty float x\nend_header\n"


def npy(shape: tuple[int, ...]) -> bytes:
    file = io.BytesIO()
    described: dict[str, Any] = {"descr": "<f4", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, described)
    return file.getvalue()


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.npy", npy((10**12, 3))),
        ("a.npy", npy((100, 3))),
        ("a.ply", PLY.format("binary_little_endian", 10**12).encode()),
        ("a.ply", PLY.format("ascii", 10**12).encode()),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 8\n"),
        ("a.ply", b"ply\n" * LONGEST_HEAD),
        ("a.pcd", PCD.format("1 1 1", 10**12, "binary").encode()),
        ("a.pcd", PCD.format("1 1 1", 10**12, "ascii").encode()),
        ("a.pcd", PCD.format("1 1 1000000000", 8, "binary").encode()),
        ("a.pcd", PCD.format("1 1 1", "1_0", "binary").encode()),
        (
            "a.pcd",
            PCD.format("1 1 1", 300_000_000, "binary_compressed").encode()
            + struct.pack("<II", 4, 3_600_000_000)
            + bytes(4),
        ),
    ],
)
def test_a_file_that_claims_more_than_it_has_is_refused(
    tmp_path: Path, name: str, content: bytes
) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(ValueError, match=r"claims to hold|has no line|must be"):
        check_claims(path)
    with pytest.raises((BadCloudFile, HugeCloud)):
        read_cloud(path, points=8)


def test_a_file_larger_than_any_cloud_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.npy"
    with path.open("wb") as file:
        file.truncate(2**40)
    with pytest.raises(ValueError, match=f"{2**40} bytes, at most {LARGEST_CLOUD_FILE} are read"):
        check_claims(path)


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
