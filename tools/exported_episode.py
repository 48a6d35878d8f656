"""What an export carries of each episode, in whatever format: its frames, and its metadata."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import polars as pl
from jaxtyping import Float32, Float64

from dnet.datasets import coherence
from dnet.datasets.index import Index
from dnet.datasets.reader import SCHEMA_VERSION, EpisodeReader
from dnet.errors import BadEpisode, NoEpisodes
from dnet.recorders.json_text import to_json
from dnet.types import Cloud, FrameKind, Nodes, Place


@dataclass(frozen=True, slots=True)
class ExportedEpisode:
    """All of an episode that is exported: not its images, its links' places, its goal and steps."""

    path: Place
    """The log."""
    name: str
    """Stem of the log: unique within the dataset, and without a slash."""
    episode: str
    """Its id."""
    meta: str
    """JSON: `schema_version`, `episode_id`, `seed`, `index`, `scene`, `settings` and `result`
    (null where the recording was cut short), as in recorders/README.md."""
    kinds: tuple[FrameKind, ...]
    """What each frame is."""
    times: Float64[np.ndarray, " f"]
    """Seconds of simulation."""
    clouds: tuple[Cloud, ...]
    """Visible surfaces, in metres."""
    grasps: Float64[np.ndarray, "f 3"]
    """Manipulation points, in metres."""
    joints: Float64[np.ndarray, "f 2 6"]
    """Joint positions of the holding and the moving arm."""
    nodes: tuple[Nodes, ...]
    """Mesh nodes: ground truth."""

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.kinds)

    def stacked_clouds(self) -> Float32[np.ndarray, "f n 3"]:
        """Return the clouds as one array.

        Raises:
            BadEpisode: If they differ in their number of points.
        """
        if not _alike(self.clouds):
            raise BadEpisode(
                self.path,
                "has clouds of several numbers of points",
                "export it to npz or hdf5, which hold them",
            )
        return np.stack(self.clouds)

    def arrays(self) -> dict[str, Any]:
        """Return everything as arrays by name.

        `clouds` (f, n, 3), or `cloud_000` and so on where they differ in their number of points;
        the same for `nodes`; `grasps` (f, 3), `joints` (f, 2, 6), `times` (f,), `kinds` (f,) as
        text, `meta` as one text.
        """
        return {
            **_by_name("clouds", "cloud", self.clouds),
            **_by_name("nodes", "nodes", self.nodes),
            "grasps": self.grasps,
            "joints": self.joints,
            "times": self.times,
            "kinds": np.array(self.kinds),
            "meta": np.array(self.meta),
        }


def read_exported(path: Place, name: str) -> ExportedEpisode:
    """Read all of an episode that is exported; its clouds are views of the file.

    Raises:
        BadEpisode: If it cannot be read.
        Unfetched: If a store does not answer.
    """
    with EpisodeReader(path) as episode:
        frames = [episode.frame(number) for number in range(len(episode))]
        meta = {"schema_version": SCHEMA_VERSION, **asdict(episode.meta), "result": episode.result}
        return ExportedEpisode(
            path=path,
            name=name,
            episode=episode.meta.episode_id,
            meta=to_json(meta),
            kinds=episode.kinds,
            times=episode.times,
            clouds=tuple(one.cloud for one in frames),
            grasps=np.array([one.grasp for one in frames]).reshape(-1, 3),
            joints=np.array([one.joints for one in frames]).reshape(-1, 2, 6),
            nodes=tuple(one.nodes for one in frames),
        )


def exported_episodes(
    index: Index, on_episode: Callable[[int, int], None] = lambda _done, _total: None
) -> Iterator[ExportedEpisode]:
    """Read the episodes of a dataset that have frames, in the order of their names, one at a time.

    Args:
        index: The dataset.
        on_episode: Called with the number of episodes that are done and of all.

    Raises:
        NoEpisodes: If none has a frame that can be read.
        BadEpisode: If two files hold the same episode, or one cannot be read any more.
        Unfetched: If a store does not answer.
    """
    files = _with_frames(index)
    for done, name in enumerate(files["name"], start=1):
        yield read_exported(index.path(name), name.removesuffix(".mcap"))
        on_episode(done, files.height)


def left_out(index: Index) -> dict[str, str]:
    """Return the files of a dataset that are not exported, and why."""
    why = pl.when(pl.col("note") == "").then(pl.lit("holds no frame")).otherwise("note")
    files = index.files.filter((pl.col("note") != "") | (pl.col("frames") == 0))
    return dict(files.select("name", why.alias("why")).iter_rows())


def points_of_all(index: Index) -> int:
    """Return how many points every cloud of a dataset has.

    Raises:
        NoEpisodes: If no episode has a frame that can be read.
        BadEpisode: If the clouds differ in it.
    """
    _with_frames(index)
    one_size = "one table holds clouds of one size: export to npz or hdf5"
    return coherence.points_of_all(index, index.frames, way_out=one_size)


def _with_frames(index: Index) -> pl.DataFrame:
    files = index.files.filter((pl.col("note") == "") & (pl.col("frames") > 0))
    if not files.height:
        raise NoEpisodes(index.root, "holds no .mcap episode with a frame that can be read")
    once = "one of them would count twice; move it elsewhere"
    coherence.refuse_doubles(index, files, way_out=once)
    return files


def _alike(clouds: Sequence[Cloud]) -> bool:
    return len({len(cloud) for cloud in clouds}) <= 1


def _by_name(several: str, one: str, clouds: Sequence[Cloud]) -> dict[str, np.ndarray]:
    if _alike(clouds):
        return {several: np.stack(clouds)}
    return {f"{one}_{number:03d}": cloud for number, cloud in enumerate(clouds)}
