"""Episodes put into another folder, by a link where that is possible: wholly or not at all."""

import os
import shutil
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

from dnet.errors import OccupiedOutput, Unwritten


def place_episodes(
    files: Mapping[str, Path],
    out: Path,
    *,
    copy: bool = False,
    on_file: Callable[[int, int], None] = lambda _done, _total: None,
) -> None:
    """Put files into a new folder.

    A hard link is a second name of the same bytes: it takes no room, and removing one leaves the
    other. Files of another disk are copied.

    Args:
        files: Where each comes from, by its name in the new folder.
        out: The folder; made if need be.
        copy: Copy even where a link would do.
        on_file: Called with the number of files that are there and of all.

    Raises:
        OccupiedOutput: If the folder already holds an episode.
        Unwritten: If it cannot be written to.
    """
    held = sorted(out.glob("*.mcap*")) if out.is_dir() else []
    if held:
        raise OccupiedOutput(out, f"{len(held)} recordings, such as {held[0].name}")
    if out.exists() and not out.is_dir():
        raise OccupiedOutput(out, "a file")
    try:
        out.mkdir(parents=True, exist_ok=True)
        for done, (name, source) in enumerate(files.items(), start=1):
            _place(source, out / name, copy=copy)
            on_file(done, len(files))
    except OSError as error:
        raise Unwritten(out, error.strerror or str(error)) from error


def _place(source: Path, target: Path, *, copy: bool) -> None:
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
