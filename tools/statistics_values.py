"""The figures of a recording, each with its meaning and unit."""

from collections.abc import Mapping
from dataclasses import dataclass

from dnet.tools.histogram import Histogram
from dnet.tools.statistics_oddities import Oddities
from dnet.tools.statistics_speed import Speed


@dataclass(frozen=True, slots=True)
class Spread:
    """How values are spread."""

    mean: float
    std: float
    """Root of the mean squared distance from the mean."""
    least: float
    greatest: float


@dataclass(frozen=True, slots=True)
class Distribution:
    """How values are spread, and how many lie where."""

    spread: Spread
    histogram: Histogram


@dataclass(frozen=True, slots=True)
class Files:
    """What lies in the directory; all other figures are of finished episodes."""

    finished: int
    unfinished: int
    broken: int
    total_bytes: int
    episode_bytes: Spread
    frame_bytes: float | None


@dataclass(frozen=True, slots=True)
class Tissues:
    """Objects of one shape; of one Young's modulus too, where there are few."""

    shape: str
    episodes: int
    shapes: int
    """Settled shapes of these objects."""
    size_mm: tuple[Spread, Spread, Spread]
    young_kpa: Spread


@dataclass(frozen=True, slots=True)
class Motions:
    """Motions between two settled frames of one episode, and how well a constant predicts them."""

    pairs: int
    mean_mm: float
    """Mean length."""
    zero_mse_mm2: float
    """Squared error of predicting no motion, mean over pairs and over x, y, z."""
    mean_mse_mm2: float
    """The same of predicting their mean: what a network that learned nothing else reaches."""


@dataclass(frozen=True, slots=True)
class Rejected:
    """Draws that were rejected for one reason."""

    reason: str
    count: int
    share: float
    """Of all draws of a shape; for `scene`, of all draws of a scene."""


@dataclass(frozen=True, slots=True)
class Draws:
    """Random draws of the episodes that say how many of theirs were rejected."""

    shapes: int
    """Of a shape, accepted or rejected."""
    scenes: int
    """Of a scene."""
    rejected_shapes: int
    rejected: tuple[Rejected, ...]


@dataclass(frozen=True, slots=True)
class Deviation:
    """How far accepted shapes are from those that the grasp reaches straight from rest."""

    mean_mm: float
    """Mean over shapes of the worst node's distance."""
    worst_mm: float


@dataclass(frozen=True, slots=True)
class Statistics:
    """All figures of a recording; None or empty where nothing is known."""

    directory: str
    files: Files
    frames: Mapping[str, int]
    """By kind."""
    cloud_points: tuple[int, int] | None
    """Fewest and most points of a cloud."""
    simulated_seconds: float
    tissues: tuple[Tissues, ...]
    displacement_mm: Mapping[str, Distribution]
    """Of the manipulation point from rest, over shapes: x, y, z in the world, length."""
    manipulation_point_mm: Mapping[str, Spread]
    """Where episodes grasp, in the object's own frame: its centre on the table, unturned."""
    any_pair: Motions | None
    """Over all ordered pairs of settled frames of one episode."""
    from_rest: Motions | None
    """From the rest frame to every shape."""
    draws: Draws | None
    deviation: Deviation | None
    oddities: Oddities
    speed: Speed | None
