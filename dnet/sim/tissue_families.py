"""Families of objects: of which sizes and stiffnesses each shape is drawn.

Young's moduli and the proportions of sizes are those of Thach, Cho, Kuntz and Hermans 2022
(Learning Visual Shape Control of Novel 3D Deformable Objects from Partial-View Point Clouds) as
their published scripts have them; each class says what is ours.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from dnet.errors import TooFew
from dnet.sim.tissue import tissue_mesh
from dnet.types import Tissue, TissueShape

Range = tuple[float, float]
Size = tuple[float, float, float]
Cells = tuple[int, int, int]

SPACING = 0.0125
"""Length and width of a mesh cell, in metres: those of the usual box."""
FLATNESS = 0.8
"""Height of a mesh cell over its length, as in the usual box."""
LEAST_CELLS: Mapping[TissueShape, Cells] = {
    "box": (4, 4, 3),
    "cylinder": (4, 6, 6),
    "hemi_ellipsoid": (8, 8, 4),
}
"""With less, a box is too stiff in bending, and round bodies lack more than 3 % of their volume."""
MOST_NODES = 500
"""Objects that would have more nodes get larger cells: a simulation step costs time by the node."""


@runtime_checkable
class Sizes(Protocol):
    """Sizes of one shape: the usual one, and others at random."""

    @property
    def usual(self) -> Size:
        """Length along x, y and z, in metres."""
        ...

    def draw(self, random: np.random.Generator) -> Size:
        """Return a random size, in metres."""
        ...


@dataclass(frozen=True, slots=True)
class BoxSizes:
    """Boxes as of the paper, at its scale of 0.7: width, then a length above it, and height."""

    usual: Size = Tissue().size
    width: Range = (0.07, 0.14)
    length: float = 0.21
    """At most; at least the width."""
    height: Range = (0.028, 0.042)

    def draw(self, random: np.random.Generator) -> Size:
        """Return a random size, in metres."""
        width = random.uniform(*self.width)
        return random.uniform(width, self.length), width, random.uniform(*self.height)


@dataclass(frozen=True, slots=True)
class CylinderSizes:
    """Round cylinders as of the paper, at its scale of 0.5. The usual one is ours."""

    usual: Size = (0.12, 0.05, 0.05)
    diameter: Range = (0.03, 0.06)
    length: Range = (0.115, 0.2)

    def draw(self, random: np.random.Generator) -> Size:
        """Return a random size, in metres."""
        diameter = random.uniform(*self.diameter)
        return random.uniform(*self.length), diameter, diameter


@dataclass(frozen=True, slots=True)
class HemiEllipsoidSizes:
    """Half ellipsoids of about the paper's proportions, at 0.7 of its size to fit our table.

    The paper's are caps of spheres, cut at half their radius: 0.29 times as high as long. They
    are as wide as long, or up to four times narrower. Ours are whole halves of ellipsoids, and
    the ranges of their proportions are ours.
    """

    usual: Size = (0.13, 0.10, 0.04)
    length: Range = (0.12, 0.18)
    width: Range = (0.5, 1.0)
    """Over the length."""
    height: Range = (0.25, 0.33)
    """Over the length."""

    def draw(self, random: np.random.Generator) -> Size:
        """Return a random size, in metres."""
        length = random.uniform(*self.length)
        return length, length * random.uniform(*self.width), length * random.uniform(*self.height)


SIZES: Mapping[TissueShape, Sizes] = {
    "box": BoxSizes(),
    "cylinder": CylinderSizes(),
    "hemi_ellipsoid": HemiEllipsoidSizes(),
}


@dataclass(frozen=True, slots=True)
class TissueFamily:
    """Objects of one shape: all alike, or each of another size and stiffness."""

    shape: TissueShape = "box"
    young: float = 1000.0
    """Young's modulus in pascals, or its mean."""
    vary: bool = False
    """Whether size and Young's modulus are drawn at random."""

    def __post_init__(self) -> None:
        """Refuse an object without stiffness.

        Raises:
            TooFew: If Young's modulus is below 1 Pa.
        """
        if not self.young >= 1:
            raise TooFew("Young's modulus in pascals", self.young, 1)

    def draw(self, random: np.random.Generator) -> Tissue:
        """Return an object of the family; draw nothing if all are alike."""
        size, young = SIZES[self.shape].usual, self.young
        if self.vary:
            size, young = SIZES[self.shape].draw(random), _young(self.young, random)
        return Tissue(self.shape, size, _cells(self.shape, size), young)


def _young(mean: float, random: np.random.Generator) -> float:
    """Return a random Young's modulus in pascals, normally distributed.

    The standard deviation is the paper's: 0.2, 1 and 1 kPa about 1, 5 and 10 kPa. Draws beyond
    three of it are drawn again, which is ours, and keeps all positive.
    """
    deviation = min(mean / 5, 1000.0)
    while True:
        young = random.normal(mean, deviation)
        if abs(young - mean) <= 3 * deviation:
            return young


def _cells(shape: TissueShape, size: Size) -> Cells:
    """Return the numbers of cells that make cells about as large as those of the usual box."""
    spacing = SPACING
    while True:
        # An even number across puts nodes in the middle, where the holding arm grips.
        wanted = (
            round(size[0] / spacing),
            2 * round(size[1] / spacing / 2),
            round(size[2] / spacing / FLATNESS),
        )
        x, y, z = (max(pair) for pair in zip(wanted, LEAST_CELLS[shape], strict=True))
        if len(tissue_mesh(Tissue(shape, size, (x, y, z))).nodes) <= MOST_NODES:
            return x, y, z
        spacing *= 1.05
