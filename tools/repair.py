"""Killed, cut-off and damaged episodes: their whole frames saved as new, readable files."""

import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import polars as pl

from dnet.datasets.directory import find_episodes, find_unfinished
from dnet.datasets.front_to_back import read_records
from dnet.datasets.mcap_file import McapFile
from dnet.datasets.reader import FRAME, EpisodeReader
from dnet.errors import (
    BadEpisode,
    BrokenRecord,
    DnetError,
    MissingPath,
    NoEpisodes,
    NothingSaved,
    OccupiedOutput,
    SharedFolder,
    Unwritten,
)
from dnet.tools.whole_frames import Salvage, copy_whole_frames

REPAIRED = "repaired"
"""Folder beside the originals: no reader of theirs looks there, so that no episode counts twice."""
COLUMNS = {
    "file": pl.String,
    "outcome": pl.String,
    "kept": pl.Int64,
    "lost": pl.Int64,
    "MB": pl.Float64,
    "note": pl.String,
}

Outcome = Literal["saved", "whole", "nothing to save", "occupied"]


@dataclass(frozen=True, slots=True)
class Repaired:
    """What became of one file."""

    file: Path
    """The original, which is as it was."""
    outcome: Outcome
    """Whether it was saved, or needed it not, or holds no whole frame, or was saved before."""
    saved: Path | None
    """The new file."""
    frames_kept: int
    """Whole frames, in the new file or in one that is whole itself."""
    frames_lost: int | None
    """None where nothing says how many there were."""
    bytes_kept: int
    """Length of the file that holds the kept frames."""
    note: str
    """What is wrong with the original, and at which byte."""


def repair(path: Path, out: Path | None = None) -> Repaired:
    """Save the whole frames of one file, unless it is whole itself.

    The new file is finished if the original was, and lost nothing but its index; otherwise its
    metadata `dnet.repair` says what happened.

    Args:
        path: An `.mcap.part` of a recording that runs or was killed, or a broken `.mcap`.
        out: Where the new file goes; by default into `repaired` beside the original.

    Raises:
        MissingPath: If there is no such file.
        SharedFolder: If `out` is where the original is.
        OccupiedOutput: If `out` already holds a file of that name.
        Unwritten: If nothing can be written there.
    """
    if not path.is_file():
        raise _missing(path)
    folder = path.parent / REPAIRED if out is None else out
    if folder.is_dir() and folder.samefile(path.parent):
        raise SharedFolder(folder)
    frames = None if path.suffix == ".part" else _whole(path)
    if frames is not None:
        return Repaired(path, "whole", None, frames, 0, path.stat().st_size, "")
    target = folder / f"{path.name.removesuffix('.part').removesuffix('.mcap')}.mcap"
    if target.exists():
        raise OccupiedOutput(target, "an episode")
    made = not folder.exists()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        return _save(path, target)
    except DnetError:
        raise
    except OSError as error:
        if not path.exists():
            raise _missing(path) from error
        raise Unwritten(folder, error.strerror or str(error)) from error
    finally:
        if made:
            with suppress(OSError):
                folder.rmdir()


def repair_directory(
    directory: Path,
    out: Path | None = None,
    *,
    on_file: Callable[[int, int], None] = lambda _done, _total: None,
) -> list[Repaired]:
    """Save the whole frames of every `.mcap.part` and of every `.mcap` that is not whole.

    Args:
        directory: Where `dnet record` or `dnet servo` wrote.
        out: Where the new files go; by default into `repaired` within it.
        on_file: Called with the number of files that are done and of all files.

    Raises:
        MissingPath: If there is no such directory.
        NoEpisodes: If it holds neither an episode nor an unfinished one.
        SharedFolder: If `out` is the directory itself.
        Unwritten: If nothing can be written into `out`.
    """
    paths = _files(directory)
    found: list[Repaired] = []
    for number, path in enumerate(paths, start=1):
        try:
            found.append(repair(path, out))
        except OccupiedOutput as error:
            found.append(Repaired(path, "occupied", None, 0, None, 0, str(error)))
        except MissingPath:
            # A recording that is running gave it its final name meanwhile, or removed it.
            continue
        finally:
            on_file(number, len(paths))
    return found


def repair_table(found: Sequence[Repaired]) -> pl.DataFrame:
    """Return one row a file: file, outcome, frames kept and lost, MB that hold them, note."""
    rows = [
        (
            one.file.name,
            one.outcome,
            one.frames_kept,
            one.frames_lost,
            one.bytes_kept / 1e6,
            one.note,
        )
        for one in found
    ]
    return pl.DataFrame(rows, schema=COLUMNS, orient="row")


def refuse_unsaved(found: Sequence[Repaired]) -> None:
    """Refuse to call it done where a broken file was not saved.

    Raises:
        NothingSaved: If one holds nothing to save.
        OccupiedOutput: If one was saved before.
    """
    nothing = [one.file.name for one in found if one.outcome == "nothing to save"]
    if nothing:
        raise NothingSaved(nothing, len(found))
    occupied = [one.file.name for one in found if one.outcome == "occupied"]
    if occupied:
        raise OccupiedOutput("directory", f"what was saved before of {', '.join(occupied[:4])}")


def _missing(path: Path) -> MissingPath:
    return MissingPath(path, "episode", "`dnet inspect ls DIRECTORY` lists what is there")


def _files(directory: Path) -> list[Path]:
    unfinished = find_unfinished(directory)
    try:
        episodes = find_episodes(directory)
    except NoEpisodes:
        if not unfinished:
            raise
        episodes = []
    return sorted([*episodes, *unfinished])


def _whole(path: Path) -> int | None:
    """Return how many frames an episode has, if it can be read and nothing of it is damaged."""
    try:
        with EpisodeReader(path) as episode:
            frames = len(episode)
        # Opening reads the frames' ends alone, and what lies between them may be damaged.
        for _ in read_records(path):
            pass
    except (BadEpisode, BrokenRecord):
        return None
    return frames


def _save(path: Path, target: Path) -> Repaired:
    part = target.with_name(target.name + ".part")
    try:
        file = part.open("xb")
    except FileExistsError as error:
        raise OccupiedOutput(part, "an unfinished episode") from error
    try:
        with file:
            salvage = copy_whole_frames(path, file)
            file.flush()
            os.fsync(file.fileno())
        why = _refused(part, salvage)
        if why:
            part.unlink()
            return Repaired(path, "nothing to save", None, 0, None, 0, why)
        if target.exists():
            raise OccupiedOutput(target, "an episode")
        part.replace(target)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    lost = 0 if salvage.finished else _lost(path, salvage.frames)
    size = target.stat().st_size
    return Repaired(path, "saved", target, salvage.frames, lost, size, salvage.reason)


def _refused(part: Path, salvage: Salvage) -> str:
    """Return why a copy is not worth keeping; nothing if a reader takes all of it."""
    if not salvage.described:
        return f"no metadata `dnet.episode`; {salvage.reason}"
    if not salvage.frames:
        return f"no whole frame; {salvage.reason}"
    try:
        with EpisodeReader(part) as episode:
            frames = len(episode)
    except BadEpisode as error:
        return str(error).removeprefix(f"{part} ").split(";")[0]
    return "" if frames == salvage.frames else f"{frames} of {salvage.frames} frames are readable"


def _lost(path: Path, kept: int) -> int | None:
    """Return how many frames a file says that it had and that were not kept, if it has an index."""
    try:
        file = McapFile(path)
    except BadEpisode:
        return None
    try:
        return max(0, len(file.entries(FRAME)) - kept)
    except BadEpisode:
        return None
    finally:
        file.close()
