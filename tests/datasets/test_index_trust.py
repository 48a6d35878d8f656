from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest

from dnet.datasets.frame_table import settled_frames
from dnet.datasets.index import FILES, FRAMES, open_index
from dnet.datasets.index_trust import LEAST_FRAME, MOST_REMOVED, worth_reading
from tests.datasets.dataset import write_dataset

Spoil = Callable[[pl.DataFrame], pl.DataFrame]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = write_dataset(tmp_path / "data", (2, 3))
    (folder / "broken.mcap").write_bytes(b"no log")
    open_index(folder)
    return folder


def files_read(folder: Path) -> int:
    read: list[int] = []
    settled_frames(open_index(folder, on_file=lambda done, _total: read.append(done)))
    return len(read)


def spoil(folder: Path, name: str, change: Spoil) -> None:
    table = change(pl.read_parquet(folder / name))
    table.write_parquet(folder / name, metadata={"dnet.index": "1"})


def put(column: str, value: object) -> Spoil:
    def change(table: pl.DataFrame) -> pl.DataFrame:
        first = pl.int_range(pl.len()) == 1
        new = pl.when(first).then(pl.lit(value)).otherwise(pl.col(column))
        return table.with_columns(new.cast(table.schema[column]).alias(column))

    return change


def test_an_index_of_its_own_is_believed_broken_files_and_all(folder: Path) -> None:
    assert files_read(folder) == 0


@pytest.mark.parametrize(
    "change",
    [
        put("sha256", "../../../etc/cron.d/x"),
        put("sha256", "/tmp/x"),  # noqa: S108
        put("sha256", None),
        put("sha256", "0" * 63 + "\n"),
        put("episode", None),
    ],
)
def test_a_file_without_a_digest_or_an_id_is_not_believed(folder: Path, change: Spoil) -> None:
    """A digest becomes the name of a table in the folder of caches."""
    spoil(folder, FILES, change)
    assert files_read(folder) == 3
    assert files_read(folder) == 0


@pytest.mark.parametrize(
    "change",
    [
        put("data", -1),
        put("data", 2**62),
        put("points", 2**31 - 1),
        put("points", -1),
        put("chunk", 2**62),
        put("length", 2**62),
        put("length", 0),
        put("message", -1),
        put("message", None),
        put("frame", 7),
        put("frame", -1),
        put("time", float("nan")),
        put("grasp_x", float("inf")),
        put("kind", None),
        put("episode", "another"),
    ],
)
def test_a_frame_that_lies_outside_its_file_is_not_believed(folder: Path, change: Spoil) -> None:
    spoil(folder, FRAMES, change)
    assert files_read(folder) == 3
    assert files_read(folder) == 0


@pytest.mark.parametrize(("name", "rows"), [(FRAMES, 50_000), (FILES, 50_000)])
def test_a_table_of_more_rows_than_the_logs_can_have_is_not_read(
    folder: Path, name: str, rows: int
) -> None:
    """Rows that are all alike take next to no room in a file."""
    path = folder / name
    table = pl.read_parquet(path)
    pl.concat([table[:1]] * rows).rechunk().write_parquet(path, metadata={"dnet.index": "1"})
    assert path.stat().st_size < rows
    contents = [(folder / one).read_bytes() for one in (FILES, FRAMES)]
    sizes = {one.name: one.stat().st_size for one in folder.glob("*.mcap")}
    assert not worth_reading(*contents, sizes=sizes)
    assert files_read(folder) == 3


def test_what_a_real_index_holds_is_far_from_the_limits(folder: Path) -> None:
    logs = list(folder.glob("episode*.mcap"))
    frames = pl.read_parquet(folder / FRAMES).height
    assert frames < sum(one.stat().st_size for one in logs) / LEAST_FRAME / 10
    assert len(logs) < MOST_REMOVED


def test_an_index_larger_than_its_logs_is_not_read(folder: Path) -> None:
    with (folder / FRAMES).open("ab") as file:
        file.truncate(2**40)
    assert files_read(folder) == 3
