"""A servo run as a short film: its scene at every step, and how far that is from the goal."""

import io
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image

from dnet.errors import BadEpisode, NoFilm
from dnet.geometry.chamfer_to import ChamferTo
from dnet.recorders.film_strip import Strip
from dnet.recorders.replay import RecordedEpisode, replay
from dnet.recorders.viewer import draw_view

WINDOW = "1280x720"
SIZE = 720, 405
"""Of the scene in the film, in pixels."""
SHARE = 0.7
"""Of the view's width that the film shows."""
STRIP = 96
"""Height of what stands below it."""
STEP_MS, FIRST_MS, LAST_MS = 160, 900, 2500
"""How long a picture stands."""
QUALITY = 72
"""Of a WebP: at this the points of a cloud still have edges."""
KINDS = (".webp", ".gif")


def film(
    episode: RecordedEpisode, out: Path, *, on_picture: Callable[[int, int], None] = lambda *_: None
) -> None:
    """Draw a servo run, from its log alone, as an animated picture that repeats for ever.

    Args:
        episode: A servo run.
        out: A .webp or .gif to write.
        on_picture: Is told how many pictures are drawn, and how many must be.

    Raises:
        NoFilm: If `out` is of another kind.
        BadEpisode: If it is no servo run, or a part of it cannot be read.
        NoPicture: If Rerun cannot draw on this machine.
    """
    if out.suffix not in KINDS:
        raise NoFilm(out, KINDS)
    steps, goal = episode.steps(), episode.target()
    if goal is None or not steps:
        raise BadEpisode(episode.path, "is no servo run", "give one of `dnet servo`")
    chamfers = np.array([1e3 * float(step["chamfer"]) for step in steps])
    motions = [1e3 * float(np.linalg.norm(step["motion"])) for step in steps]
    floor = None if goal.again is None else 1e3 * ChamferTo(goal.cloud).gaps(goal.again).chamfer
    with tempfile.TemporaryDirectory() as directory:
        recording = Path(directory) / "run.rrd"
        replay(episode, recording, company="film")
        scenes = draw_view(
            recording,
            [float(step["time"]) for step in steps],
            window=WINDOW,
            on_picture=lambda done: on_picture(done, len(steps)),
        )
    strip = Strip(chamfers, floor, size=(SIZE[0], STRIP))
    pictures = [
        _joined(scene, strip.draw(number, motion=motions[number]))
        for number, scene in enumerate(scenes)
    ]
    _write(out, pictures)


def _joined(scene: bytes, strip: Image.Image) -> Image.Image:
    """Return a scene, cut to the film's shape, with a strip below it."""
    picture = Image.open(io.BytesIO(scene)).convert("RGB")
    width, height = SIZE
    wide = min(SHARE * picture.width, picture.height * width / height)
    tall = wide * height / width
    # The arms come from above: less is lost below the object, where the table is empty.
    left, top = (picture.width - wide) / 2, (picture.height - tall) / 4
    cut = picture.resize(SIZE, Image.Resampling.LANCZOS, box=(left, top, left + wide, top + tall))
    joined = Image.new("RGB", (width, height + strip.height))
    joined.paste(cut, (0, 0))
    joined.paste(strip, (0, height))
    return joined


def _write(out: Path, pictures: list[Image.Image]) -> None:
    durations = [STEP_MS] * len(pictures)
    durations[0], durations[-1] = FIRST_MS, LAST_MS
    out.parent.mkdir(parents=True, exist_ok=True)
    part = out.with_name(out.name + ".part")
    pictures[0].save(
        part,
        format=out.suffix[1:],
        save_all=True,
        append_images=pictures[1:],
        duration=durations,
        loop=0,
        quality=QUALITY,
        method=6,
    )
    part.replace(out)
