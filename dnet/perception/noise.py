"""What a real depth camera does to an image: it wavers, frays the edges and loses pixels there."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float32, Float64

from dnet.errors import NotAFraction
from dnet.geometry.camera import DepthImage

EDGE_STEP = 0.01
"""Neighbouring pixels farther apart in depth than this have an edge between them, in metres."""
EDGE_WIDTH = 2
"""How many pixels from an edge are still near it."""
NOTHING = -1


@dataclass(frozen=True, slots=True)
class DepthNoise:
    """The noise of a structured-light camera, after Nguyen, Izadi and Lovell (3DIMPVT 2012).

    Each pixel is independent of the others and of the next image. The terms of that model that
    tell only on surfaces seen at more than 60 degrees are left out; the dropout is not theirs.
    """

    scale: float = 1.0
    """How strong all of it is: 1 is the published camera, a first Kinect, and 0 none. At 0.5 m
    that camera wavers by 1.2 mm; a finer one takes a smaller scale."""
    lateral: float = 0.8
    """Standard deviation of where a pixel near an edge looks,, in pixels."""
    dropout: float = 0.1
    """Share of the pixels near an edge that see nothing."""

    def __post_init__(self) -> None:
        if not 0.0 <= self.dropout <= 1.0:
            raise NotAFraction("dropout", self.dropout)

    def apply(self, image: DepthImage, *, random: np.random.Generator) -> DepthImage:
        """Return `image` as the camera would give it.

        A lost pixel is `camera.far` deep and shows nothing (-1). Every image takes the same
        number of draws, whatever it shows.

        Args:
            image: What an ideal camera sees.
            random: Where the noise comes from.
        """
        shape = image.depth.shape
        shifts = random.standard_normal((2, *shape))
        draws = random.random(shape)
        wavers = random.standard_normal(shape)

        near = near_edges(image.depth)
        down, right = np.rint(self.scale * self.lateral * shifts * near).astype(np.int64)
        v, u = np.indices(shape)
        v = np.clip(v + down, 0, shape[0] - 1)
        u = np.clip(u + right, 0, shape[1] - 1)
        depth, mask = image.depth[v, u].astype(np.float64), image.mask[v, u]

        seen = mask != NOTHING
        depth[seen] += self.scale * (axial_deviation(depth) * wavers)[seen]
        lost = near & (draws < self.scale * self.dropout)
        depth[lost] = image.camera.far
        mask[lost] = NOTHING
        return replace(image, depth=depth.astype(np.float32), mask=mask)


def axial_deviation(depth: Float64[np.ndarray, "h w"]) -> Float64[np.ndarray, "h w"]:
    """Return the standard deviation of a depth, in metres (Nguyen et al. 2012)."""
    return 0.0012 + 0.0019 * (depth - 0.4) ** 2


def near_edges(depth: Float32[np.ndarray, "h w"]) -> Bool[np.ndarray, "h w"]:
    """Return which pixels have a jump in depth within `EDGE_WIDTH` pixels, up, down or aside."""
    near = np.zeros(depth.shape, bool)
    down = np.abs(np.diff(depth, axis=0)) > EDGE_STEP
    right = np.abs(np.diff(depth, axis=1)) > EDGE_STEP
    near[:-1] |= down
    near[1:] |= down
    near[:, :-1] |= right
    near[:, 1:] |= right
    for _ in range(EDGE_WIDTH - 1):
        wider = near.copy()
        wider[:-1] |= near[1:]
        wider[1:] |= near[:-1]
        wider[:, :-1] |= near[:, 1:]
        wider[:, 1:] |= near[:, :-1]
        near = wider
    return near
