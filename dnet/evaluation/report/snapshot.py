"""What a log knows of one instant of a run: the object's surface, its cloud, both arms."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial.transform import Rotation

from dnet.datasets.reader import EpisodeReader
from dnet.geometry.pose import pose
from dnet.sim.tissue import tissue_mesh
from dnet.types import ARMS, Cloud, Nodes, Pose, Tissue, Transform

Triangles = Int64[np.ndarray, "_ 3"]
Path3 = Float64[np.ndarray, "_ 3"]

_INSTRUMENT = ("insertion_link", "roll_link", "wrist_pitch_link", "wrist_yaw_link", "tip_link")


@dataclass(frozen=True, slots=True)
class Snapshot:
    """One instant."""

    time: float
    """Seconds of simulation."""
    cloud: Cloud
    nodes: Nodes
    triangles: Triangles
    """Of the object's surface, rows of `nodes`; none if the nodes are not those of its mesh."""
    instruments: tuple[Path3, ...]
    """Of each arm, from where its instrument is inserted to the tip."""


def snapshot(run: EpisodeReader, index: int) -> Snapshot:
    """Return what the log of a run knows of frame `index`.

    Raises:
        NoSuchFrame: If there is no such frame.
        BadEpisode: If one of its messages is not what it should be.
    """
    nodes = run.nodes(index)
    places = _places(run.transforms(index))
    instruments = []
    for arm in ARMS:
        links = [places[name] for link in _INSTRUMENT if (name := f"{arm}/{link}") in places]
        if links:
            instruments.append(np.stack([link[:3, 3] for link in links]))
    return Snapshot(
        float(run.times[index]),
        run.cloud(index),
        nodes,
        surface_of(run.meta.scene.tissue, nodes),
        tuple(instruments),
    )


def surface_of(tissue: Tissue, nodes: Nodes | None) -> Triangles:
    """Return the triangles of an object's surface, if `nodes` are those of its mesh."""
    mesh = tissue_mesh(tissue)
    if nodes is None or len(nodes) != len(mesh.nodes):
        return np.zeros((0, 3), np.int64)
    return mesh.surface()


def _places(transforms: Sequence[Transform]) -> dict[str, Pose]:
    """Return where each frame stands in the world; parents come before their children."""
    places: dict[str, Pose] = {"world": np.eye(4)}
    for one in transforms:
        turn = Rotation.from_quat(one.rotation).as_matrix()
        places[one.child] = places[one.parent] @ pose(turn, one.translation)
    return places
