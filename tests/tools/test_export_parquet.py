"""polars and pyarrow read the frames from Parquet bit for bit."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import polars as pl
import pyarrow.parquet as pq
import pytest

from dnet.datasets.index import open_index
from dnet.tools.export_parquet import export_parquet
from dnet.tools.parquet_stream import ROWS_A_GROUP, write_tables
from tests.tools.exported import assert_frames, logged, logged_meta, plain, write_exportable


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_exportable(tmp_path_factory.mktemp("exported") / "data")


def arrays(table: pl.DataFrame) -> dict[str, object]:
    """The columns as arrays by name."""
    joints = [table[f"joints_{side}"].to_numpy() for side in ("left", "right")]
    return {
        "kinds": table["kind"].to_list(),
        "times": table["time"].to_numpy(),
        "clouds": table["cloud"].to_numpy(),
        "grasps": table["grasp"].to_numpy(),
        "joints": np.stack(joints, axis=1),
        "nodes": [one.to_numpy() for one in table["nodes"]],
    }


def assert_table(table: pl.DataFrame, log: Path) -> None:
    assert_frames(arrays(table), logged(log))
    meta = plain(logged_meta(log))
    assert table["episode"].unique().to_list() == [meta["episode_id"]]
    assert table["frame"].to_list() == list(range(table.height))
    first, *others = table["meta"]
    assert json.loads(first) == meta
    assert not any(others)


def test_polars_reads_the_frames_bit_for_bit(tmp_path: Path, data: Path) -> None:
    done = export_parquet(open_index(data), tmp_path / "all.parquet")
    table = pl.read_parquet(tmp_path / "all.parquet")
    assert table.height == done.frames == 19
    assert table.schema["cloud"] == pl.Array(pl.Float32, (64, 3))
    assert table.schema["grasp"] == pl.Array(pl.Float64, 3)
    for number, part in enumerate(table.partition_by("episode", maintain_order=True)):
        assert_table(part, data / f"episode-{number}.mcap")


def test_each_episode_may_have_a_file_of_its_own(tmp_path: Path, data: Path) -> None:
    export_parquet(open_index(data), tmp_path / "out", per_episode=True)
    files = sorted((tmp_path / "out").iterdir())
    assert [path.name for path in files] == [f"episode-{number}.parquet" for number in range(3)]
    for path in files:
        assert_table(pl.read_parquet(path), data / f"{path.stem}.mcap")


def test_other_libraries_find_arrays_of_fixed_size(tmp_path: Path, data: Path) -> None:
    export_parquet(open_index(data), tmp_path / "all.parquet")
    # Three episodes, one group: tables are joined up to the size of a group.
    assert pq.ParquetFile(tmp_path / "all.parquet").num_row_groups == 1
    table = pq.read_table(tmp_path / "all.parquet")
    cloud = table.schema.field("cloud").type
    assert (cloud.list_size, cloud.value_type.list_size) == (64, 3)
    flat = table["cloud"].combine_chunks().flatten().flatten().to_numpy()
    frames = [one for path in sorted(data.glob("episode*")) for one in logged(path)]
    assert flat.tobytes() == np.stack([one.cloud for one in frames]).tobytes()


def test_tables_are_asked_for_as_they_are_written_and_groups_are_small(tmp_path: Path) -> None:
    path, seen = tmp_path / "long.parquet", []
    block = 50

    def tables() -> Iterator[pl.DataFrame]:
        for number in range(200):
            seen.append(path.stat().st_size if path.exists() else 0)
            values = np.random.default_rng(number).random((block, 500), np.float32)
            yield pl.DataFrame({"number": [number] * block, "values": values})

    write_tables(tables(), path)
    # Of 20 MB most is on the disk long before the last is made.
    assert seen[150] > 2e6
    assert pl.read_parquet(path)["number"].to_list() == np.repeat(np.arange(200), block).tolist()
    file = pq.ParquetFile(path)
    rows = [file.metadata.row_group(number).num_rows for number in range(file.num_row_groups)]
    assert max(rows) == ROWS_A_GROUP
