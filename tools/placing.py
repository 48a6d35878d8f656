"""Episodes put into another folder, by a link where that is possible: all of them or none."""

import os
import shutil
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path

from dnet.errors import DnetError, OccupiedOutput, Unwritten


def place_episodes(
    files: Mapping[str, Path],
    out: Path,
    *,
    copy: bool = False,
    on_file: Callable[[int, int], None] = lambda _done, _total: None,
) -> None:
    """Put files into a new folder.

    A hard link is a second name of the same bytes: it takes no room, and removing one leaves the
    other. Files of another disk are copied. What was placed before a failure is removed again.

    Args:
        files: Where each comes from, by its name in the new folder.
        out: The folder; made if need be.
        copy: Copy even where a link would do.
        on_file: Called with the number of files that are there and of all.

    Raises:
        OccupiedOutput: If the folder already holds an episode.
        Unwritten: If it cannot be written to.
    """
    refuse_occupied(out)
    made = not out.exists()
    placed: list[Path] = []
    try:
        out.mkdir(parents=True, exist_ok=True)
        for done, (name, source) in enumerate(files.items(), start=1):
            _place(source, out / name, copy=copy)
            placed.append(out / name)
            on_file(done, len(files))
    except BaseException as error:
        _remove(placed, out if made else None)
        if isinstance(error, OSError) and not isinstance(error, DnetError):
            raise Unwritten(out, error.strerror or str(error)) from error
        raise


def refuse_occupied(out: Path) -> None:
    """Refuse a folder that something would be lost in, or mixed with.

    Raises:
        OccupiedOutput: If it already holds an episode, or is a file.
    """
    held = sorted(out.glob("*.mcap*")) if out.is_dir() else []
    if held:
        raise OccupiedOutput(out, f"{len(held)} recordings, such as {held[0].name}")
    if out.exists() and not out.is_dir():
        raise OccupiedOutput(out, "a file")


def _remove(placed: Sequence[Path], folder: Path | None) -> None:
    # The first error matters more than one of these.
    with suppress(OSError):
        for path in placed:
            path.unlink()
        if folder is not None:
            folder.rmdir()


def _place(source: Path, target: Path, *, copy: bool) -> None:
    # A link to a symbolic link would be one as well, and lead nowhere from another folder.
    source = source.resolve()
    if target.exists():
        raise OccupiedOutput(target, "an episode")
    if not copy:
        # Another disk, or a file system without links: then by a copy.
        with suppress(OSError):
            os.link(source, target)
            return
    part = target.with_name(f"{target.name}.part")
    try:
        shutil.copyfile(source, part)
        part.replace(target)
    finally:
        part.unlink(missing_ok=True)
