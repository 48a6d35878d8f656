"""What a network meets that it may not have learned from: objects, cameras, clouds."""

from dataclasses import dataclass, field
from typing import Literal

from dnet.perception.cloud import POINTS
from dnet.sim.tissue_families import TissueFamily


@dataclass(frozen=True, slots=True)
class Condition:
    """One of them."""

    name: str
    about: str
    """What differs."""
    inside: bool
    """Whether the network that ships learned from the like: boxes of 10 x 10 x 4 cm and 1 kPa, a
    perfect camera, clouds of 2048 points."""
    world: Literal["bullet", "quasistatic"] = "quasistatic"
    tissue: TissueFamily = field(default_factory=TissueFamily)
    points: int = POINTS
    noise: float = 0.0
    """Of the depth camera; 1 is that of a Kinect."""

    @property
    def folder(self) -> str:
        """What its directories are called."""
        return self.name.replace(" ", "-")

    @property
    def distribution(self) -> str:
        """What `inside` is called."""
        return "in distribution" if self.inside else "out of distribution"


CONDITIONS: tuple[Condition, ...] = (
    Condition("box 1 kPa", "nothing but poses and grasps", inside=True),
    Condition("box 1 kPa in PyBullet", "dynamics", inside=True, world="bullet"),
    Condition(
        "box 5 kPa in PyBullet",
        "stiffness",
        inside=False,
        world="bullet",
        tissue=TissueFamily(young=5_000.0),
    ),
    Condition(
        "box 10 kPa in PyBullet",
        "stiffness",
        inside=False,
        world="bullet",
        tissue=TissueFamily(young=10_000.0),
    ),
    Condition(
        "boxes of any size",
        "size, and stiffness about 1 kPa",
        inside=False,
        tissue=TissueFamily(vary=True),
    ),
    Condition("cylinder", "shape", inside=False, tissue=TissueFamily("cylinder")),
    Condition("hemi-ellipsoid", "shape", inside=False, tissue=TissueFamily("hemi_ellipsoid")),
    Condition("noise 1", "noise of the depth camera, of a Kinect", inside=False, noise=1.0),
    Condition("noise 2", "noise of the depth camera, twice that", inside=False, noise=2.0),
    Condition(
        "1024 points", "points of a cloud, and a network for them", inside=False, points=1024
    ),
    Condition("512 points", "points of a cloud, and a network for them", inside=False, points=512),
)
"""Stiffnesses and shapes are those of the follow-ups (ICRA 2022, T-RO 2024). Stiffness is varied
in PyBullet: without gravity the shape at rest does not depend on it, only how it is come to."""
