"""`dnet play`: recordings in the Rerun viewer, or as a picture."""

from dataclasses import dataclass
from pathlib import Path

import tyro


@dataclass(frozen=True)
class Play:
    """Play episodes and servo runs back in Rerun, or draw a picture of one without a screen.

    The view shows the object (blue), its goal (green), both arms, the motion that was asked for
    (arrow), and curves of shape distance, motion and joints. An episode without a goal shows
    its last shape in the goal's place.

    Example: dnet play runs/servo/run.rrd --screenshot run.png
    """

    files: tyro.conf.Positional[tuple[Path, ...]]
    """Episodes (`.mcap`) and runs (`.rrd`); unfinished ones (`.part`) play too."""
    screenshot: Path | None = None
    """Draw the first file into this PNG instead of opening a window."""
    save: Path | None = None
    """Write the first file as this Rerun recording (`.rrd`) instead of opening a window."""
    at: float | None = None
    """When to draw the picture, in seconds of simulation; left out, the end of a servo run, or
    an episode's largest motion."""

    def run(self) -> None:
        """Show the files."""
        from dnet.datasets.reader import EpisodeReader
        from dnet.recorders.playback import play

        play(
            self.files,
            open_episode=EpisodeReader,
            screenshot=self.screenshot,
            save=self.save,
            seconds=self.at,
        )
        for written in (self.screenshot, self.save):
            if written is not None:
                print(written)
