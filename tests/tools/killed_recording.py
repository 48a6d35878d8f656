"""A process that records on and on, to be killed; each is a fork of one that has imported all.

Reads paths from standard input, a line each. For each it forks a recorder, which prints its
process number, and after each frame that is in how many are. When that has died it prints "gone".
"""

import os
import sys
from dataclasses import replace
from pathlib import Path

from dnet.recorders.episode import EpisodeWriter
from dnet.types import Frame
from tests.recorders.rollout import ARMS, frames, meta

MOST_FRAMES = 5000
"""Nobody records for ever, even if nobody kills him."""
SMALL, LARGE = frames(3), frames(2, points=30_000)
"""Those of the large ones are longer than a chunk."""


def recorded(index: int, *, large: bool) -> Frame:
    """The frame that a recorder adds as number `index`."""
    seen = LARGE if large else SMALL
    return replace(seen[index % len(seen)], time=index / 8)


def record(path: Path) -> None:
    large = path.stem.endswith("large")
    with EpisodeWriter(path, meta(path.stem), arms=ARMS, attachments={"a.txt": b"text"}) as writer:
        for index in range(MOST_FRAMES):
            writer.add(recorded(index, large=large))
            say(f"{index + 1}")


def say(text: str) -> None:
    # In one call, unbuffered: a line is out whole or not at all.
    os.write(1, f"{text}\n".encode())


def main() -> None:
    for line in sys.stdin:
        child = os.fork()
        if not child:
            try:
                say(f"{os.getpid()}")
                record(Path(line.rstrip("\n")))
            finally:
                os._exit(1)
        os.waitpid(child, 0)
        say("gone")


if __name__ == "__main__":
    main()
