"""Boxes around an arm's links, along the world's axes: what is far apart needs no closer look."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from xml.etree import ElementTree

import numpy as np
from jaxtyping import Bool, Float64
from scipy.spatial.transform import Rotation

from dnet.geometry.pose import pose
from dnet.sim.furniture import Block
from dnet.sim.psm import Psm
from dnet.sim.psm_links import LINK_JOINTS, link_frames
from dnet.sim.urdf import psm_tree
from dnet.types import JointPath, Pose


@dataclass(frozen=True)
class Boxes:
    """Boxes along the axes of the world."""

    low: Float64[np.ndarray, "... 3"]
    """The least corner of each, in metres."""
    high: Float64[np.ndarray, "... 3"]
    """The greatest corner of each."""

    def near(self, others: "Boxes", *, margin: float) -> Bool[np.ndarray, "..."]:
        """Return which boxes are within `margin` of which of the others along every axis.

        What is inside of any that are not is farther apart than that.

        Args:
            others: Boxes in a row, (m, 3).
            margin: In metres.

        Returns:
            The axes of these boxes and one for the others, (..., m).
        """
        low, high = self.low[..., None, :] - margin, self.high[..., None, :] + margin
        return np.asarray(((low <= others.high) & (high >= others.low)).all(axis=-1))


def arm_boxes(arm: Psm, path: JointPath) -> Boxes:
    """Return a box around each solid of an arm at each row of a joint path, (n, k, 3)."""
    steps = link_frames(path)
    frames = {"base_link": np.broadcast_to(arm.base, (len(path), 4, 4))}
    for number, link in enumerate(LINK_JOINTS):
        frames[link.child] = frames[link.parent] @ steps[:, number]
    solids = _solids()
    placed = np.stack([frames[solid.link] for solid in solids], axis=1)
    placed = placed @ np.stack([solid.place for solid in solids])
    halves = np.stack([solid.half for solid in solids])
    reach = (np.abs(placed[..., :3, :3]) @ halves[:, :, None])[..., 0]
    return Boxes(placed[..., :3, 3] - reach, placed[..., :3, 3] + reach)


def block_boxes(blocks: Sequence[Block]) -> Boxes:
    """Return a box around each block, (n, 3)."""
    centres = np.array([block.centre for block in blocks])
    halves = np.array([block.size for block in blocks]) / 2
    return Boxes(centres - halves, centres + halves)


@dataclass(frozen=True)
class _Solid:
    """What an arm can touch with: a box, or the box around a cylinder."""

    link: str
    place: Pose
    """In the frame of its link."""
    half: Float64[np.ndarray, "3"]
    """Half its edges, in metres."""


@cache
def _solids() -> tuple[_Solid, ...]:
    """Read the solids from what Bullet loads, so that the two cannot differ."""
    found = []
    for link in psm_tree().findall("link"):
        for shape in link.findall("collision"):
            origin, geometry = shape.find("origin"), shape.find("geometry")
            if origin is None or geometry is None:
                raise ValueError(f"link {link.get('name')} has a shape without place or form")
            turn = Rotation.from_euler("xyz", _numbers(origin, "rpy")).as_matrix()
            place = pose(turn, _numbers(origin, "xyz"))
            found.append(_Solid(link.get("name", ""), place, _half(geometry[0])))
    return tuple(found)


def _half(form: ElementTree.Element) -> Float64[np.ndarray, "3"]:
    if form.tag == "box":
        return _numbers(form, "size") / 2
    radius, length = float(form.get("radius", "nan")), float(form.get("length", "nan"))
    return np.array([radius, radius, length / 2])


def _numbers(element: ElementTree.Element, name: str) -> Float64[np.ndarray, "3"]:
    return np.array([float(number) for number in element.get(name, "").split()])
