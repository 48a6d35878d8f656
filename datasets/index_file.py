"""The bytes of an index: packed records a frame, then lines of CSV a file, under a checksum.

No length in it but the number of records, which is held against the bytes that there are: tables
of richer formats say lengths in every page, and a wrong one of those can end the process that reads
it. Whose a frame is, and its number, is not stored: the frames of each file follow one another.
"""

import struct
from io import BytesIO
from typing import Any
from zlib import crc32

import numpy as np
import polars as pl
from numpy.typing import NDArray
from polars.exceptions import PanicException, PolarsError

from dnet.datasets.index_rows import FILE_COLUMNS, FRAME_COLUMNS, KINDS

MAGIC = b"dnet.ix2"
"""How an index begins; its digit changes with what it holds, and another's is not read."""

_HEAD = struct.Struct("<8sI")
"""`MAGIC`, and the CRC-32 of all that follows."""
HEAD = _HEAD.size
"""Bytes of it."""
_COUNT = struct.Struct("<Q")
"""Of frames."""
_NOWHERE = -1
"""In place of where the points of a compressed cloud lie."""
_RECORD = np.dtype(
    [
        ("kind", "u1"),  # its place in `KINDS`
        ("time", "<f8"),
        *((f"{what}_{axis}", "<f8") for what in ("grasp", "motion") for axis in "xyz"),
        ("points", "<i4"),
        ("content", "<u8"),
        *((name, "<i8") for name in ("chunk", "length", "message", "data")),
    ]
)


def pack_index(files: pl.DataFrame, frames: pl.DataFrame) -> bytes:
    """Return both tables as bytes.

    Args:
        files: Rows as of `FILE_COLUMNS`.
        frames: Rows as of `FRAME_COLUMNS`: all of the first file, then all of the next.
    """
    records = np.empty(frames.height, _RECORD)
    columns = frames.with_columns(
        pl.col("kind").to_physical(), pl.col("data").fill_null(_NOWHERE)
    ).select(_RECORD.names)
    for column in columns:
        records[column.name] = column.to_numpy()
    lines = BytesIO()
    # With quotes, for a text that is empty is not one that is missing.
    files.write_csv(lines, include_header=False, quote_style="non_numeric")
    body = b"".join((_COUNT.pack(len(records)), records.tobytes(), lines.getbuffer()))
    return sealed(body)


def sealed(body: bytes) -> bytes:
    """Return an index of what follows its head."""
    return _HEAD.pack(MAGIC, crc32(body)) + body


def unpack_index(content: bytes, *, most: int) -> tuple[pl.DataFrame, pl.DataFrame]:
    """Return the tables of files and frames of an index that anybody may have made.

    What they say need not be true: `dnet.datasets.index_trust` judges that.

    Args:
        content: The bytes.
        most: Files that it may be of.

    Raises:
        ValueError: If it is no index, one of another version or of more files, or damaged.
    """
    try:
        return _unpack(memoryview(content), most)
    # Polars may also give up in the middle.
    except (struct.error, PolarsError, PanicException) as error:
        raise ValueError(str(error)) from error


def _unpack(content: memoryview, most: int) -> tuple[pl.DataFrame, pl.DataFrame]:
    magic, told = _HEAD.unpack_from(content)
    body = content[HEAD:]
    if magic != MAGIC or told != crc32(body):
        raise ValueError("no index of this version, or a changed one")
    (count,) = _COUNT.unpack_from(body)
    end = _COUNT.size + count * _RECORD.itemsize
    if end > len(body):
        raise ValueError(f"{count} frames in {len(body)} bytes")
    files = pl.read_csv(BytesIO(body[end:]), has_header=False, schema=FILE_COLUMNS, n_rows=most + 1)
    if files.height > most:
        raise ValueError(f"more than {most} files")
    return files, _frames(files, np.frombuffer(body[_COUNT.size : end], _RECORD))


def _frames(files: pl.DataFrame, records: NDArray[Any]) -> pl.DataFrame:
    lengths = files["frames"]
    if lengths.null_count() or not lengths.is_between(0, len(records)).all():
        raise ValueError("a file of an impossible number of frames")
    each = lengths.to_numpy()
    if each.sum() != len(records) or (records["kind"] >= len(KINDS.categories)).any():
        raise ValueError("frames of no file, or of no kind")
    file = np.repeat(np.arange(len(each)), each)
    columns: dict[str, Any] = {name: records[name] for name in _RECORD.names or ()}
    columns |= {name: files[name].gather(file) for name in ("name", "episode")}
    columns["kind"] = KINDS.categories.gather(records["kind"])
    columns["frame"] = np.arange(len(records)) - np.repeat(np.cumsum(each) - each, each)
    frames = pl.DataFrame({name: columns[name] for name in FRAME_COLUMNS}, schema=FRAME_COLUMNS)
    nowhere = pl.col("data") == _NOWHERE
    return frames.with_columns(data=pl.when(~nowhere).then("data"))
