"""Files of arrays that become larger than they look: refused before there is memory for them."""

import io
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dnet.errors import BadArrays
from dnet.tools.imported_arrays import LARGEST_ARRAYS, read_arrays


def member(shape: tuple[int, ...], content: bytes) -> bytes:
    file = io.BytesIO()
    described: dict[str, Any] = {"descr": "<f4", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(file, described)
    return file.getvalue() + content


def test_an_array_of_more_numbers_than_there_are_bytes_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("clouds.npy", member((10**6, 10**4, 3), bytes(12)))
    with pytest.raises(BadArrays, match="an array of 120000000000 bytes, of which there are 140"):
        read_arrays(path)


def test_a_bomb_is_not_unpacked(tmp_path: Path) -> None:
    path, piece = tmp_path / "a.npz", bytes(2**24)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("clouds.npy", piece)
    content = bytearray(path.read_bytes())
    # What its directory says of its size is what it would be unpacked to.
    place = content.index(b"PK\1\2") + 24
    content[place : place + 4] = (LARGEST_ARRAYS + 1).to_bytes(4, "little")
    path.write_bytes(content)
    with pytest.raises(BadArrays, match=f"{LARGEST_ARRAYS + 1} bytes when unpacked"):
        read_arrays(path)


@pytest.mark.parametrize("name", ["../../x", "/etc/passwd", "a\nb", "..\\x", "x" * 60_000])
def test_names_of_arrays_lead_nowhere(tmp_path: Path, name: str) -> None:
    inside = tmp_path / "inside"
    inside.mkdir()
    path = inside / "a.npz"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr(f"{name}.npy", member((1,), bytes(4)))
    with pytest.raises(BadArrays, match="neither `clouds`"):
        read_arrays(path)
    assert sorted(tmp_path.rglob("*")) == [inside, path]
