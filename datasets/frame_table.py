"""The settled frames of an index as plain arrays: what a loader needs of each, 60 bytes."""

import hashlib
from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
import polars as pl
from jaxtyping import Bool, Float64, Int32, Int64

from dnet.datasets.coherence import points_of_all, refuse_doubles
from dnet.datasets.index import Index
from dnet.datasets.index_rows import AXES
from dnet.errors import NoEpisodes, TooFew
from dnet.types import Place

SETTLED = ("rest", "shape")
"""Kinds of frame that pairs are made of; what is seen on the way is still moving."""
COMPRESSED = -1
"""In place of where a cloud's points lie in the file: they are found through their chunk."""


@dataclass(frozen=True, slots=True)
class FrameTable:
    """Frames of several episodes, those of one together and in their order."""

    root: Place
    names: tuple[str, ...]
    """The files, one an episode."""
    versions: tuple[str, ...]
    """Of each file: what changes when it does."""
    digests: tuple[str, ...]
    """Of each file: its SHA-256."""
    episodes: tuple[str, ...]
    """Of each file: the id of its episode."""
    points: int
    """Of every cloud."""
    file: Int32[np.ndarray, " n"]
    """Which of the files each frame is in."""
    frame: Int32[np.ndarray, " n"]
    """Its number in the episode."""
    rest: Bool[np.ndarray, " n"]
    """Whether it shows the rest shape."""
    grasps: Float64[np.ndarray, "n 3"]
    """The manipulation point, in metres."""
    data: Int64[np.ndarray, " n"]
    """Where in the file its points lie as packed float32, or `COMPRESSED`."""
    places: Int64[np.ndarray, "n 3"]
    """Where its chunk begins, how long that is, and where in it the message of its cloud is."""

    def __len__(self) -> int:
        return len(self.file)

    @property
    def lengths(self) -> Int64[np.ndarray, " e"]:
        """Frames of each file, in order; some may have none."""
        return np.bincount(self.file, minlength=len(self.names)).astype(np.int64)

    @property
    def episodes_seen(self) -> list[str]:
        """The ids of the episodes that the frames are of, sorted."""
        return sorted({self.episodes[file] for file in np.unique(self.file).tolist()})

    @property
    def fingerprint(self) -> str:
        """What changes when one of the files does, or other frames of them are taken."""
        digest = hashlib.sha256("\n".join(self.digests).encode())
        digest.update(self.file.tobytes())
        digest.update(self.frame.tobytes())
        return digest.hexdigest()[:16]

    def of_episodes(self, ids: Collection[str]) -> "FrameTable":
        """Return the frames of these episodes alone."""
        wanted = np.array([episode in ids for episode in self.episodes])
        return self.where(wanted[self.file])

    def where(self, mask: Bool[np.ndarray, " n"]) -> "FrameTable":
        """Return the frames of which `mask` is true."""
        return replace(
            self,
            file=self.file[mask],
            frame=self.frame[mask],
            rest=self.rest[mask],
            grasps=self.grasps[mask],
            data=self.data[mask],
            places=self.places[mask],
        )


def settled_frames(index: Index) -> FrameTable:
    """Return the settled frames of all episodes that can be read.

    Raises:
        NoEpisodes: If no file can be read.
        TooFew: If there is no settled frame.
        BadEpisode: If clouds differ in their number of points, or two files hold one episode.
    """
    files = index.files.filter(pl.col("note") == "")
    if not files.height:
        raise NoEpisodes(index.root, "holds no .mcap episode that can be read")
    judged = "a network would be judged by what it has learned; remove one of them"
    refuse_doubles(index, files, way_out=judged)
    frames = index.frames.filter(pl.col("kind").is_in(SETTLED))
    if not frames.height:
        raise TooFew(f"number of settled frames in {index.root}", 0, 1)
    one_number = "use episodes that were recorded with one number of points"
    points = points_of_all(index, frames, way_out=one_number)
    numbers = pl.DataFrame({"name": files["name"], "file": np.arange(files.height, dtype=np.int32)})
    frames = frames.join(numbers, on="name", maintain_order="left")
    return FrameTable(
        index.root,
        tuple(files["name"]),
        tuple(files["version"]),
        tuple(files["sha256"]),
        tuple(files["episode"]),
        points,
        frames["file"].to_numpy(),
        frames["frame"].to_numpy(),
        (frames["kind"] == "rest").to_numpy(),
        frames.select(f"grasp_{axis}" for axis in AXES).to_numpy(),
        frames["data"].fill_null(COMPRESSED).to_numpy(),
        frames.select("chunk", "length", "message").to_numpy(),
    )
