from pathlib import Path

import numpy as np
import pytest

from dnet.datasets.table_cache import TableCache, Tables, cache_folder


class Computed:
    """Tables that count how often they were computed."""

    def __init__(self) -> None:
        self.times = 0

    def __call__(self) -> Tables:
        self.times += 1
        return {"a": np.arange(6, dtype=np.int16).reshape(2, 3), "b": np.ones(2, np.float32)}


def test_tables_are_computed_once_for_each_content_and_version(tmp_path: Path) -> None:
    compute = Computed()
    cache = TableCache(tmp_path / "cache", "things", "1")
    for _ in range(3):
        found = cache.get("digest", compute)
        assert found.keys() == {"a", "b"}
        np.testing.assert_array_equal(found["a"], [[0, 1, 2], [3, 4, 5]])
        assert found["a"].dtype == np.int16
    assert compute.times == 1
    cache.get("other", compute)
    TableCache(tmp_path / "cache", "things", "2").get("digest", compute)
    assert compute.times == 3


def test_a_spoilt_file_is_computed_anew(tmp_path: Path) -> None:
    compute = Computed()
    cache = TableCache(tmp_path, "things", "1")
    cache.get("digest", compute)
    (path,) = tmp_path.rglob("*.safetensors")
    path.write_bytes(path.read_bytes()[:-3])
    cache.get("digest", compute)
    cache.get("digest", compute)
    assert compute.times == 2
    assert [file.name for file in tmp_path.rglob("*") if file.is_file()] == [path.name]


def test_a_folder_that_cannot_be_made_costs_time_alone(tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"")
    compute = Computed()
    cache = TableCache(tmp_path / "file", "things", "1")
    assert len(cache.get("digest", compute)["b"]) == 2
    assert len(cache.get("digest", compute)["b"]) == 2
    assert compute.times == 2


def test_tables_lie_beside_the_data_and_those_of_a_url_on_this_machine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert cache_folder(tmp_path).is_relative_to(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert not str(cache_folder("s3://bucket/data")).startswith("s3:")
