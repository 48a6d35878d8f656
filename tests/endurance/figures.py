"""What a process and its children hold at one instant: memory, files, threads, disk."""

import ctypes
import gc
import os
from collections.abc import Iterable
from csv import DictReader, writer
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import psutil


@dataclass(frozen=True, slots=True)
class Figures:
    """What was held after one round."""

    round: int
    hours: float
    """Since the first round began."""
    rss: int
    """Bytes of memory that the process and its children have in RAM, shared pages included."""
    anonymous: int
    """Those that are of no file: all that was allocated, and what the allocator keeps of it. Pages
    of files are left out, for whether they count as its own depends on who else has them mapped."""
    heap: int
    """Bytes that C code of this process has asked for and not given back."""
    objects: int
    """Python's containers in this process: what a reference that was not dropped keeps."""
    handles: int
    """Open files, pipes and sockets of the process and its children."""
    threads: int
    processes: int
    disk: int
    """Bytes under the directory that everything is written to, caches and scratch included."""
    files: int
    """Files and folders there."""


def measure(folder: Path, *, number: int, hours: float) -> Figures:
    """Return what this process, its children and a folder hold now.

    Args:
        folder: What the disk is measured of.
        number: Of the round.
        hours: Since the first round began.
    """
    gc.collect()  # what only waits for the collector is no leak
    here = psutil.Process()
    tree = [here, *here.children(recursive=True)]
    there = list(_under(folder))
    return Figures(
        round=number,
        hours=hours,
        rss=sum(process.memory_info().rss for process in tree),
        anonymous=sum(part.anonymous for process in tree for part in process.memory_maps()),
        heap=_heap(),
        objects=len(gc.get_objects()),
        handles=sum(process.num_fds() for process in tree),
        threads=sum(process.num_threads() for process in tree),
        processes=len(tree),
        disk=sum(path.lstat().st_size for path in there if path.is_file()),
        files=len(there),
    )


class _Heap(ctypes.Structure):
    """What glibc tells of its allocator: see mallinfo(3)."""

    _fields_ = tuple(
        (name, ctypes.c_size_t)
        for name in (
            "arena", "ordblks", "smblks", "hblks", "hblkhd",
            "usmblks", "fsmblks", "uordblks", "fordblks", "keepcost",
        )
    )  # fmt: skip


def _heap() -> int:
    ask = ctypes.CDLL(None).mallinfo2
    ask.restype = _Heap
    told = ask()
    return int(told.uordblks + told.hblkhd)


def _under(folder: Path) -> Iterable[Path]:
    for parent, folders, files in os.walk(folder):
        yield from (Path(parent, name) for name in (*folders, *files))


class Table:
    """The figures of all rounds, in a CSV that each round is written to at once."""

    def __init__(self, path: Path) -> None:
        self.rows: list[Figures] = []
        self._file = path.open("x", encoding="utf-8", newline="")
        self._writer = writer(self._file)
        self._writer.writerow(field.name for field in fields(Figures))

    def add(self, row: Figures) -> None:
        """Write one row."""
        self.rows.append(row)
        self._writer.writerow(asdict(row).values())
        self._file.flush()

    def close(self) -> None:
        """Close the file."""
        self._file.close()


def read_table(path: Path) -> list[Figures]:
    """Return the rows that a `Table` wrote."""
    with path.open(encoding="utf-8", newline="") as file:
        return [
            Figures(
                hours=float(row.pop("hours")), **{name: int(value) for name, value in row.items()}
            )
            for row in DictReader(file)
        ]
