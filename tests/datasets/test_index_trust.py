from collections.abc import Callable
from pathlib import Path

import polars as pl
import pytest

from dnet.datasets.frame_table import settled_frames
from dnet.datasets.index import INDEX, open_index
from dnet.datasets.index_file import pack_index, unpack_index
from dnet.datasets.index_trust import MOST_REMOVED, SHARE, most_bytes
from tests.datasets.dataset import write_dataset
from tests.recorders import rollout

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


def same(table: pl.DataFrame) -> pl.DataFrame:
    return table


def spoil(folder: Path, *, files: Spoil = same, frames: Spoil = same) -> None:
    stored = unpack_index((folder / INDEX).read_bytes(), most=9)
    (folder / INDEX).write_bytes(pack_index(files(stored[0]), frames(stored[1])))


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
        put("object", None),
        put("scene", None),
        put("finished", None),
        put("shapes", None),
        put("young", float("nan")),
        put("size_x", None),
        put("seconds", float("inf")),
    ],
)
def test_a_file_without_what_all_files_have_is_not_believed(folder: Path, change: Spoil) -> None:
    """A digest becomes the name of a table in the folder of caches."""
    spoil(folder, files=change)
    assert files_read(folder) == 3
    assert files_read(folder) == 0


@pytest.mark.parametrize(
    "change",
    [
        put("data", -2),
        put("data", 2**62),
        put("points", 2**31 - 1),
        put("points", -1),
        put("chunk", 2**62),
        put("length", 2**62),
        put("length", 0),
        put("message", -1),
        put("time", float("nan")),
        put("grasp_x", float("inf")),
    ],
)
def test_a_frame_that_lies_outside_its_file_is_not_believed(folder: Path, change: Spoil) -> None:
    spoil(folder, frames=change)
    assert files_read(folder) == 3
    assert files_read(folder) == 0


def test_a_file_of_other_bytes_than_it_has_is_read_again(folder: Path) -> None:
    """What its frames say is held against them."""
    spoil(folder, files=put("bytes", 2**62), frames=put("data", 2**61))
    assert files_read(folder) == 1
    assert files_read(folder) == 0


def test_a_file_that_comes_twice_is_not_believed(folder: Path) -> None:
    spoil(folder, files=lambda table: pl.concat([table, table[:1]]).sort("name"), frames=twice)
    assert files_read(folder) == 3


def twice(frames: pl.DataFrame) -> pl.DataFrame:
    first = frames.filter(pl.col("name") == frames["name"][0])
    return pl.concat([first, frames])


def test_an_index_of_many_more_files_than_there_are_is_made_anew(folder: Path) -> None:
    def more(files: pl.DataFrame) -> pl.DataFrame:
        removed = files.filter(pl.col("note") != "").with_columns(name=pl.lit("removed.mcap"))
        return pl.concat([files, *[removed] * (MOST_REMOVED + 1)])

    spoil(folder, files=more)
    assert files_read(folder) == 3


def test_what_a_real_index_holds_is_far_from_the_limits(tmp_path: Path) -> None:
    log = rollout.write(tmp_path / "one.mcap", rollout.frames(3, points=2048))
    open_index(tmp_path)
    size = log.stat().st_size
    assert (tmp_path / INDEX).stat().st_size < size / SHARE / 10 < most_bytes([size])


def test_an_index_larger_than_its_logs_is_not_read(folder: Path) -> None:
    with (folder / INDEX).open("ab") as file:
        file.truncate(2**40)
    assert files_read(folder) == 3
