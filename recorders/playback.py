"""Playing what was recorded: episodes and runs, in a window, as a picture or as a recording."""

import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

from dnet.errors import MissingPath, OccupiedOutput, TooFew, UnknownRecording
from dnet.recorders.replay import OpenEpisode, replay
from dnet.recorders.salvage import whole_recording
from dnet.recorders.viewer import draw, show


def play(
    files: Sequence[Path],
    *,
    open_episode: OpenEpisode,
    screenshot: Path | None = None,
    save: Path | None = None,
    seconds: float | None = None,
) -> None:
    """Show episodes (`.mcap`) and runs (`.rrd`), also unfinished ones (`.part`).

    Args:
        files: What to show; a picture and a saved recording take the first alone.
        open_episode: Opens an episode file.
        screenshot: Draw one picture into this file instead of opening a window.
        save: Write the recording to this `.rrd` instead of opening a window.
        seconds: When to draw the picture, in seconds of simulation; left out, the end of a
            servo run and the largest motion of an episode.

    Raises:
        TooFew: If there are no files.
        MissingPath: If a file does not exist.
        UnknownRecording: If a file is neither an episode nor a run.
        BadEpisode: If an episode or a run cannot be read.
        OccupiedOutput: If `save` is already there.
    """
    if not files:
        raise TooFew("number of files to play", 0, 1)
    if save is not None and save.exists():
        raise OccupiedOutput(save, "a Rerun recording")
    for file in files:
        _check(file)
    with tempfile.TemporaryDirectory() as directory:
        chosen = files if screenshot is None and save is None else files[:1]
        shown: list[tuple[Path, float | None]] = []
        for number, file in enumerate(chosen):
            # A directory each, for two files may have the same name.
            place = Path(directory) / str(number)
            place.mkdir()
            shown.append(_recording(file, place, open_episode))
        recording, best = shown[0]
        if save is not None:
            save.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(recording, save)
        if screenshot is not None:
            draw(recording, screenshot, seconds=best if seconds is None else seconds)
        if screenshot is None and save is None:
            show([path for path, _ in shown])


def _recording(file: Path, place: Path, open_episode: OpenEpisode) -> tuple[Path, float | None]:
    """Return `file` as an `.rrd`, and the time that shows it best if that is known."""
    name = file.name.removesuffix(".part")
    if name.endswith(".rrd"):
        return whole_recording(file, place), None
    copy = place / Path(name).with_suffix(".rrd").name
    episode = open_episode(file)
    try:
        return copy, replay(episode, copy)
    finally:
        episode.close()


def _check(file: Path) -> None:
    name = file.name.removesuffix(".part")
    if not name.endswith((".mcap", ".rrd")):
        raise UnknownRecording(file)
    if not file.is_file():
        hint = "`dnet inspect ls DIRECTORY` lists what was recorded"
        if (part := file.with_name(file.name + ".part")).is_file():
            hint = f"its recording did not finish; play what there is of it as {part}"
        raise MissingPath(file, "recording", hint)
