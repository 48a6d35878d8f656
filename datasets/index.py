"""The index of a dataset: a row a file and a row a frame, kept beside the logs and up to date.

It can be thrown away: it is made from the logs, and made anew where it is missing, stale, damaged,
untrue or of another version.
"""

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import polars as pl

from dnet.datasets.index_file import pack_index, unpack_index
from dnet.datasets.index_rows import FILE_COLUMNS, FileRows, read_rows
from dnet.datasets.index_trust import MOST_REMOVED, believable, most_bytes
from dnet.datasets.listing import Listed, list_logs
from dnet.datasets.sources import said
from dnet.datasets.stores import as_place, file_system, is_url, join
from dnet.errors import NoEpisodes, TooLarge, Unfetched, Unwritten, WorkerDied
from dnet.files.sizes import read_at_most
from dnet.files.whole_file import write_whole
from dnet.types import Place

INDEX = "index.dnet"
FILES_A_PROCESS = 64
"""New files that are worth the start of one more process."""
REQUESTS = 16
"""Files of a store that are fetched at a time."""


@dataclass(frozen=True)
class Index:
    """All that is known of a dataset without its clouds."""

    root: Place
    files: pl.DataFrame
    """A row a file, sorted by name; columns as in `FILE_COLUMNS`."""
    frames: pl.DataFrame
    """A row a frame, in the order of the files; columns as in `FRAME_COLUMNS`."""

    def path(self, name: str) -> Place:
        """Return where a file of the dataset is."""
        return join(self.root, name)

    def broken(self) -> pl.DataFrame:
        """Return the files of which nothing can be read."""
        return self.files.filter(pl.col("note") != "")


def open_index(
    root: Place,
    *,
    workers: int | None = None,
    on_file: Callable[[int, int], None] = lambda _done, _total: None,
) -> Index:
    """Return the index of the logs in a folder or under a URL, brought up to date.

    Only new and changed files are read. The index is written back where that is possible and it
    holds a frame; a folder that cannot be written to is indexed all the same.

    Args:
        root: With `.mcap` files; `.part` files, recordings that run or were killed, don't count.
        workers: Processes to read with, or requests at a time for a URL; None for a good number.
        on_file: Called with the number of files read and of all that must be.

    Raises:
        MissingPath: If there is no such folder.
        NoEpisodes: If it holds no `.mcap` file.
        Unfetched: If a store does not answer.
        WorkerDied: If a process that reads is killed.
    """
    root = as_place(root)
    listed = list_logs(root)
    if not listed:
        raise NoEpisodes(root)
    stored = _load(root, listed)
    kept = _unchanged(stored, listed)
    if stored is not None and not _believable(stored, kept):
        stored, kept = None, set()
    wanted = [one for one in listed if one.name not in kept]
    if stored is not None and not wanted and len(kept) == stored.files.height:
        return stored
    read = list(_read(root, wanted, workers, on_file))
    index = _merged(root, stored, kept, read)
    if index.frames.height or stored is not None:
        # Without a frame there is nothing to find again: who is refused leaves no trace.
        _store(index)
    return index


def _unchanged(stored: Index | None, listed: Sequence[Listed]) -> set[str]:
    """Return the names of the files that are what they were when they were indexed."""
    if stored is None:
        return set()
    known = set(stored.files.select("name", "version", "bytes").iter_rows())
    return {one.name for one in listed if (one.name, one.version, one.size) in known}


def _read(
    root: Place,
    wanted: Sequence[Listed],
    workers: int | None,
    on_file: Callable[[int, int], None],
) -> Iterator[FileRows]:
    count = _workers(root, len(wanted)) if workers is None else workers
    if count <= 1:
        for done, one in enumerate(wanted, start=1):
            yield _rows(root, one)
            on_file(done, len(wanted))
        return
    try:
        with _executor(root, count) as executor:
            found = executor.map(partial(_rows, root), wanted)
            for done, rows in enumerate(found, start=1):
                yield rows
                on_file(done, len(wanted))
    except BrokenProcessPool as error:
        raise WorkerDied(
            f"read the logs in {root}", "they are as they were, run the same command again"
        ) from error


def _workers(root: Place, files: int) -> int:
    if is_url(root):
        return min(REQUESTS, files)
    return min(os.cpu_count() or 1, files // FILES_A_PROCESS)


def _executor(root: Place, count: int) -> Executor:
    if is_url(root):
        return ThreadPoolExecutor(count)
    # A fork of a process with threads may hang.
    return ProcessPoolExecutor(count, mp_context=get_context("spawn"))


def _rows(root: Place, one: Listed) -> FileRows:
    return read_rows(root, one.name, version=one.version, size=one.size)


def _merged(root: Place, stored: Index | None, kept: set[str], read: Sequence[FileRows]) -> Index:
    files = [pl.DataFrame([rows.file for rows in read], schema=FILE_COLUMNS, orient="row")]
    frames = [rows.frames for rows in read]
    if stored is not None:
        files.append(stored.files.filter(pl.col("name").is_in(kept)))
        frames.append(stored.frames.filter(pl.col("name").is_in(kept)))
    return Index(
        root,
        pl.concat(files).sort("name"),
        pl.concat(frames).sort("name", "frame", maintain_order=True),
    )


def _believable(stored: Index, kept: set[str]) -> bool:
    """Return whether what it says of the files that are still there can be true."""
    there = pl.col("name").is_in(kept)
    return believable(stored.files.filter(there), stored.frames.filter(there))


def _load(root: Place, listed: Sequence[Listed]) -> Index | None:
    """Return the index as it was stored, None if there is none that can be used."""
    try:
        content = _content(root, most=most_bytes(one.size for one in listed))
        return Index(root, *unpack_index(content, most=len(listed) + MOST_REMOVED))
    except (OSError, ValueError, Unfetched, TooLarge):
        return None


def _content(root: Place, *, most: int) -> bytes:
    if not is_url(root):
        return read_at_most(Path(root) / INDEX, most, what="index")
    files, path = file_system(str(root), doing="reading")
    try:
        if (size := files.info(f"{path}/{INDEX}")["size"]) > most:
            raise TooLarge("index", join(root, INDEX), size, most)
        content: bytes = files.cat_file(f"{path}/{INDEX}")
    except TooLarge:
        raise
    # Stores raise what they like.
    except Exception as error:
        raise Unfetched(str(join(root, INDEX)), said(error)) from error
    return content


def _store(index: Index) -> None:
    """Write the index where that is possible."""
    content = pack_index(index.files, index.frames)
    # An index that cannot be kept costs time, and nothing else: stores raise what they like.
    with suppress(Exception if is_url(index.root) else Unwritten):
        _put(index.root, content)


def _put(root: Place, content: bytes) -> None:
    if is_url(root):
        files, path = file_system(str(root), doing="writing to")
        files.pipe_file(f"{path}/{INDEX}", content)
    else:
        write_whole(Path(root) / INDEX, content)
