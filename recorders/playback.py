"""Playing what was recorded: episodes and runs, in a window, as a picture or as a recording."""

import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, ExitStack, closing, nullcontext
from pathlib import Path

from dnet.errors import MissingPath, OccupiedOutput, TooFew, UnknownRecording, Unmerged
from dnet.files.whole_file import whole_file
from dnet.recorders.blueprint import Company
from dnet.recorders.replay import OpenEpisode, application, replay, replay_beside
from dnet.recorders.salvage import whole_recording
from dnet.recorders.viewer import draw, show
from dnet.recorders.viewer_process import RERUN
from dnet.types import Place

Progress = Callable[[int, int], None]
"""Is told how many files are made ready, and how many must be."""


def play(
    files: Sequence[Place],
    *,
    open_episode: OpenEpisode,
    screenshot: Path | None = None,
    save: Path | None = None,
    seconds: float | None = None,
    beside: bool = False,
    watched: AbstractContextManager[Progress] | None = None,
) -> None:
    """Show episodes (`.mcap`) and runs (`.rrd`), also unfinished ones (`.part`).

    All episodes of one kind are recordings of one application, which share its layout; they are
    made ready one at a time, and on the disk.

    Args:
        files: What to show; the URL of an episode will do. A picture shows the first alone.
        open_episode: Opens an episode file.
        screenshot: Draw one picture into this file instead of opening a window.
        save: Write the recordings to this `.rrd` instead of opening a window.
        seconds: When to draw the picture, in seconds of simulation; left out, the end of a
            servo run and the largest motion of an episode.
        beside: Show servo runs (`.mcap`) side by side in one view, instead of each by itself.
        watched: Entered while the files are made ready, and told how far that is.

    Raises:
        TooFew: If there are no files.
        MissingPath: If a file does not exist.
        UnknownRecording: If a file is neither an episode nor a run.
        BadEpisode: If an episode or a run cannot be read.
        OccupiedOutput: If `save` is already there.
        Unmerged: If Rerun cannot write several recordings into one file.
    """
    # A file that is named twice is one recording.
    chosen = list(dict.fromkeys(files))
    if not chosen:
        raise TooFew("number of files to play", 0, 1)
    if save is not None and save.exists():
        raise OccupiedOutput(save, "a Rerun recording")
    for file in chosen:
        _check(file)
    if save is None and screenshot is not None and not beside:
        chosen = chosen[:1]
    with tempfile.TemporaryDirectory() as directory:
        with watched or nullcontext(_unwatched) as progress:
            ready = _made_beside if beside and len(chosen) > 1 else _made_ready
            shown = ready(chosen, Path(directory), open_episode, progress)
        recordings = [path for path, _ in shown]
        first, best = shown[0]
        if save is not None:
            _save(recordings, save)
        if screenshot is not None:
            draw(first, screenshot, seconds=best if seconds is None else seconds)
        if screenshot is None and save is None:
            show(recordings)


def _unwatched(done: int, total: int) -> None:
    pass


def _made_ready(
    files: Sequence[Place], directory: Path, open_episode: OpenEpisode, progress: Progress
) -> list[tuple[Path, float | None]]:
    """Return each file as an `.rrd`, and the time that shows it best if that is known."""
    shown: list[tuple[Path, float | None]] = []
    laid_out: set[str] = set()
    progress(0, len(files))
    for number, file in enumerate(files):
        # A directory each, for two files may have the same name.
        place = directory / str(number)
        place.mkdir()
        if _name(file).endswith(".rrd"):
            shown.append((whole_recording(Path(file), place), None))
        else:
            company: Company = "alone" if len(files) == 1 else "several"
            shown.append(_converted(file, place, open_episode, laid_out, company))
        progress(number + 1, len(files))
    return shown


def _made_beside(
    files: Sequence[Place], directory: Path, open_episode: OpenEpisode, progress: Progress
) -> list[tuple[Path, float | None]]:
    """Return all of them as one `.rrd`, and the time that shows it best."""
    copy = directory / "beside.rrd"
    progress(0, 1)
    with ExitStack() as opened:
        episodes = [opened.enter_context(closing(open_episode(file))) for file in files]
        best = replay_beside(episodes, copy)
    progress(1, 1)
    return [(copy, best)]


def _converted(
    file: Place,
    place: Path,
    open_episode: OpenEpisode,
    laid_out: set[str],
    company: Company,
) -> tuple[Path, float]:
    """Return an episode as an `.rrd`, with a layout if it is the first of its application."""
    copy = place / Path(_name(file)).with_suffix(".rrd").name
    episode = open_episode(file)
    try:
        kind = application(episode)
        best = replay(episode, copy, company=None if kind in laid_out else company)
    finally:
        episode.close()
    laid_out.add(kind)
    return copy, best


def _save(recordings: Sequence[Path], save: Path) -> None:
    if len(recordings) == 1:
        with whole_file(save) as part:
            shutil.copyfile(recordings[0], part)
        return
    save.parent.mkdir(parents=True, exist_ok=True)
    part = save.with_name(save.name + ".part")
    command = [*RERUN, "rrd", "merge", *map(str, recordings), "-o", str(part)]
    merged = subprocess.run(command, capture_output=True, text=True, check=False)
    if merged.returncode:
        part.unlink(missing_ok=True)
        raise Unmerged(save, len(recordings), " ".join(merged.stderr.split())[-300:])
    part.replace(save)


def _name(file: Place) -> str:
    return str(file).rpartition("/")[2].removesuffix(".part")


def _check(file: Place) -> None:
    if isinstance(file, Path) and not file.is_file():
        hint = "`dnet inspect ls DIRECTORY` lists what was recorded"
        if (part := file.with_name(file.name + ".part")).is_file():
            hint = f"its recording did not finish; play what there is of it as {part}"
        raise MissingPath(file, "recording", hint)
    if not _name(file).endswith((".mcap", ".rrd")):
        raise UnknownRecording(Path(file))
    # Whether a store has an episode shows when that is opened; a run is no such file.
    if isinstance(file, str) and not file.endswith(".mcap"):
        raise MissingPath(file, "recording", "copy it to this machine, and play the copy")
