from pathlib import Path

import numpy as np
import pytest

from dnet.datasets.table_cache import TableCache, cache_folder
from dnet.errors import Unwritten

DTYPE = np.dtype([("frame", "<i4"), ("near", "<i2", (3,))], align=True)


def records() -> np.ndarray:
    made = np.zeros(4, DTYPE)
    made["frame"], made["near"] = np.arange(4), np.arange(12).reshape(4, 3)
    return made


def test_records_come_back_by_content_and_version(tmp_path: Path) -> None:
    cache = TableCache(tmp_path / "cache", "things", "1")
    assert cache.find("digest", DTYPE) is None
    cache.put("digest", records())
    found = cache.find("digest", DTYPE)
    assert isinstance(found, np.memmap)
    np.testing.assert_array_equal(found, records())
    assert cache.find("other", DTYPE) is None
    assert TableCache(tmp_path / "cache", "things", "2").find("digest", DTYPE) is None
    assert len([path for path in tmp_path.rglob("*") if path.is_file()]) == 1


@pytest.mark.parametrize("kept", [0, 5, 60, -3])
def test_a_file_that_is_not_whole_is_as_good_as_none(tmp_path: Path, kept: int) -> None:
    cache = TableCache(tmp_path, "things", "1")
    cache.put("digest", records())
    (path,) = tmp_path.rglob("*.npy")
    path.write_bytes(path.read_bytes()[:kept])
    assert cache.find("digest", DTYPE) is None


def test_records_of_another_kind_and_pickles_are_as_good_as_none(tmp_path: Path) -> None:
    cache = TableCache(tmp_path, "things", "1")
    cache.put("digest", records())
    assert cache.find("digest", np.dtype([("frame", "<i4")])) is None
    (path,) = tmp_path.rglob("*.npy")
    with path.open("wb") as file:
        np.save(file, np.array([{}], dtype=object), allow_pickle=True)
    assert cache.find("digest", DTYPE) is None


def test_a_folder_that_cannot_be_made_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    with pytest.raises(Unwritten, match="nothing can be written into"):
        TableCache(tmp_path / "file", "things", "1").put("digest", records())


def test_tables_lie_beside_the_data_and_those_of_a_url_on_this_machine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert cache_folder(tmp_path).is_relative_to(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    elsewhere = cache_folder("s3://bucket/data")
    assert not str(elsewhere).startswith("s3:")
    # A folder that is not to be written to; of one that is not there, the system says the same.
    assert cache_folder(tmp_path / "none") == elsewhere
