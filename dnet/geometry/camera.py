"""A depth camera: pinhole intrinsics, pose, and the way from pixels back to points."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float32, Float64, Int32

from dnet.geometry.pose import look_at
from dnet.types import Cloud, Pose


@dataclass(frozen=True, eq=False)
class Pinhole:
    """Where each pixel of a camera looks: all that turning depth back into points takes."""

    width: int
    """Pixels across."""
    height: int
    """Pixels down."""
    intrinsics: Float64[np.ndarray, "3 3"]
    """The matrix K: pixel (u, v), counted from 0 at the upper left, looks along
    inv(K) @ (u, v, 1), with no half pixel added."""
    pose: Pose
    """Camera in the world: x right, y down, z forward, (4, 4)."""

    def points(self, depth: Float32[np.ndarray, "h w"], chosen: Bool[np.ndarray, "h w"]) -> Cloud:
        """Return the points in the world that the chosen pixels show, row by row, (n, 3)."""
        v, u = np.nonzero(chosen)
        z = depth[v, u].astype(np.float64)
        rays = np.linalg.inv(self.intrinsics) @ np.stack([u, v, np.ones_like(u)])
        world = self.pose[:3, :3] @ (rays * z) + self.pose[:3, 3:]
        return np.ascontiguousarray(world.T, dtype=np.float32)


@dataclass(frozen=True)
class Camera:
    """A pinhole camera above the table, in front of the object."""

    width: int = 256
    """Pixels across."""
    height: int = 192
    """Pixels down."""
    field_of_view: float = 0.52
    """Vertical opening angle in radians."""
    eye: tuple[float, float, float] = (0.0, -0.30, 0.42)
    """Where the camera stands, in metres."""
    target: tuple[float, float, float] = (0.005, 0.0, 0.035)
    """The point in the middle of its image, in metres."""
    near: float = 0.1
    """Nearest distance along the optical axis that it sees, in metres."""
    far: float = 2.0
    """Farthest distance along the optical axis that it sees, in metres."""

    @cached_property
    def pose(self) -> Pose:
        """Camera in the world: x right, y down, z forward, (4, 4)."""
        return look_at(np.array(self.eye), np.array(self.target))

    @cached_property
    def focal_length(self) -> float:
        """Focal length in pixels, the same in both directions."""
        return self.height / 2 / float(np.tan(self.field_of_view / 2))

    @cached_property
    def intrinsics(self) -> Float64[np.ndarray, "3 3"]:
        """The matrix K that takes camera coordinates to pixel indices.

        Bullet's software renderer shoots the ray of pixel (u, v) through the image plane at
        x = 2u/w - 1, y = 1 - 2(v + 1)/h, not through the middle of the pixel: with the principal
        point at (w/2, h/2 - 1), points lie on the true surface.
        """
        f = self.focal_length
        return np.array([[f, 0.0, self.width / 2], [0.0, f, self.height / 2 - 1], [0.0, 0.0, 1.0]])

    @cached_property
    def pinhole(self) -> Pinhole:
        """Where each of its pixels looks."""
        return Pinhole(self.width, self.height, self.intrinsics, self.pose)


@dataclass(frozen=True)
class DepthImage:
    """What a depth camera sees: distance and owner of each pixel."""

    depth: Float32[np.ndarray, "h w"]
    """Distance along the optical axis in metres; `camera.far` where nothing is."""
    mask: Int32[np.ndarray, "h w"]
    """Which body each pixel shows, -1 for none."""
    camera: Camera


def unproject(image: DepthImage, chosen: Bool[np.ndarray, "h w"]) -> Cloud:
    """Return the points in the world that the chosen pixels show, row by row, (n, 3)."""
    return image.camera.pinhole.points(image.depth, chosen)
