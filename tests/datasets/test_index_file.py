import struct
from pathlib import Path

import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dnet.datasets.index import INDEX, open_index
from dnet.datasets.index_file import HEAD, MAGIC, pack_index, sealed, unpack_index
from dnet.datasets.index_rows import FILE_COLUMNS, FRAME_COLUMNS
from tests.datasets.dataset import write_dataset
from tests.fuzz.targets import CORPUS

FILE = dict.fromkeys(FILE_COLUMNS) | {"note": "", "frames": 0}
COUNT = struct.Struct("<Q")
RECORD = 101
"""Bytes of a frame."""


@pytest.fixture(scope="module")
def tables(tmp_path_factory: pytest.TempPathFactory) -> tuple[pl.DataFrame, pl.DataFrame]:
    index = open_index(write_dataset(tmp_path_factory.mktemp("data"), (2, 3)))
    # As of a cloud that is compressed.
    nowhere = index.frames.with_columns(data=pl.when(pl.col("frame") > 0).then("data"))
    return index.files, nowhere


def test_what_is_read_is_what_was_written(tables: tuple[pl.DataFrame, pl.DataFrame]) -> None:
    files, frames = unpack_index(pack_index(*tables), most=2)
    assert files.equals(tables[0])
    assert frames.equals(tables[1])
    assert frames["data"].null_count() == 2
    assert dict(files.schema) == FILE_COLUMNS
    assert dict(frames.schema) == FRAME_COLUMNS


_NAMES = {
    pl.String: st.none() | st.text(st.characters(codec="utf-8"), max_size=6),
    pl.Int64: st.none() | st.integers(-(2**63), 2**63 - 1),
    pl.Float64: st.none() | st.floats(allow_nan=False),
    pl.Boolean: st.none() | st.booleans(),
}


@settings(max_examples=30)
@given(
    rows=st.lists(
        st.fixed_dictionaries(
            {name: _NAMES[kind] for name, kind in FILE_COLUMNS.items()} | {"frames": st.just(0)}
        ),
        min_size=1,
        max_size=5,
    )
)
def test_any_text_and_number_of_a_file_stays_what_it_is(rows: list[dict[str, object]]) -> None:
    files = pl.DataFrame(rows, schema=FILE_COLUMNS, orient="row")
    found, frames = unpack_index(pack_index(files, pl.DataFrame(schema=FRAME_COLUMNS)), most=5)
    assert found.equals(files)
    assert frames.height == 0


def test_every_flipped_bit_is_noticed(tables: tuple[pl.DataFrame, pl.DataFrame]) -> None:
    content = bytearray(pack_index(*tables))
    for place in range(len(content)):
        content[place] ^= 1 << place % 8
        with pytest.raises(ValueError, match="no index of this version, or a changed one"):
            unpack_index(bytes(content), most=2)
        content[place] ^= 1 << place % 8


def test_every_part_of_an_index_is_none(tables: tuple[pl.DataFrame, pl.DataFrame]) -> None:
    content = pack_index(*tables)
    for length in range(0, len(content), 7):
        with pytest.raises(ValueError, match=r"."):
            unpack_index(content[:length], most=2)


@pytest.mark.parametrize("count", [0, 7, 9, 2**32, 2**63, 2**64 - 1])
def test_frames_that_are_not_there_are_not_read(
    tables: tuple[pl.DataFrame, pl.DataFrame], count: int
) -> None:
    """The one length that an index says."""
    body = pack_index(*tables)[HEAD:]
    assert COUNT.unpack_from(body) == (tables[1].height,) == (8,)
    with pytest.raises(ValueError, match=r"."):
        unpack_index(sealed(COUNT.pack(count) + body[COUNT.size :]), most=2)


@pytest.mark.parametrize("frames", [[8, -1, 1], [8, 2**63 - 1, 1], [3, 4, 0], [8, None, 0]])
def test_files_of_other_frames_than_there_are_are_refused(
    tables: tuple[pl.DataFrame, pl.DataFrame], frames: list[int | None]
) -> None:
    files = pl.concat([tables[0], tables[0][:1]]).with_columns(frames=pl.Series(frames))
    with pytest.raises(ValueError, match="frames"):
        unpack_index(pack_index(files, tables[1]), most=3)


def test_a_frame_of_no_kind_is_refused(tables: tuple[pl.DataFrame, pl.DataFrame]) -> None:
    body = bytearray(pack_index(*tables)[HEAD:])
    body[COUNT.size + RECORD] = 3
    with pytest.raises(ValueError, match="of no kind"):
        unpack_index(sealed(bytes(body)), most=2)


def test_more_files_than_there_can_be_are_not_read() -> None:
    files = pl.DataFrame([FILE] * 1000, schema=FILE_COLUMNS, orient="row")
    content = pack_index(files, pl.DataFrame(schema=FRAME_COLUMNS))
    assert unpack_index(content, most=1000)[0].height == 1000
    with pytest.raises(ValueError, match="more than 999 files"):
        unpack_index(content, most=999)


def test_a_table_that_ends_the_process_that_reads_it_is_none(tmp_path: Path) -> None:
    """Two tables of Parquet with a wrong length in a page: Polars asks for 2 EB, and aborts."""
    table = (CORPUS / "index" / "parquet").read_bytes()
    folder = write_dataset(tmp_path / "data", (1,))
    for content in (table, table[4:], MAGIC + table, sealed(table)):
        (folder / INDEX).write_bytes(content)
        assert open_index(folder).frames.height == 1
