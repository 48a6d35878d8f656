"""Rerun recordings made whole: the viewer opens none whose writer was killed."""

import subprocess
import warnings
from pathlib import Path

from rerun.chunk import RrdReader

from dnet.errors import BadEpisode
from dnet.recorders.viewer_process import RERUN

SALVAGE_SECONDS = 300.0


def whole_recording(file: Path, place: Path) -> Path:
    """Return `file` if the viewer can open it, or what is left of it, written into `place`.

    A killed writer leaves a recording without the index at its end.

    Raises:
        BadEpisode: If nothing can be read of it.
    """
    if file.suffix == ".rrd" and _holds_index(file):
        return file
    copy = place / file.name.removesuffix(".part")
    merge = [*RERUN, "rrd", "merge", "--continue-on-error", str(file), "-o", str(copy)]
    # Rerun goes by what a file holds, not by its name, when it merges.
    merged = subprocess.run(merge, capture_output=True, timeout=SALVAGE_SECONDS, check=False)
    if merged.returncode == 0 and copy.is_file() and _holds_index(copy):
        return copy
    raise BadEpisode(
        file, "is not a Rerun recording, or broken beyond reading", "give an .rrd of `dnet servo`"
    )


def _holds_index(file: Path) -> bool:
    """Return whether Rerun finds an index, and a recording in it."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return bool(RrdReader(file).recordings())
        except (RuntimeError, ValueError, Warning):
            return False
