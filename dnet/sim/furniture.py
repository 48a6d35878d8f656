"""What stands around the object besides the arms: the table and the camera on its stand."""

from dataclasses import dataclass
from typing import Literal

from dnet.geometry.camera import Camera

STAND_RADIUS = 0.012
CAMERA_SIZE = (0.08, 0.04, 0.04)


@dataclass(frozen=True, slots=True)
class Block:
    """A box or an upright cylinder."""

    name: str
    shape: Literal["box", "cylinder"]
    size: tuple[float, float, float]
    """Edges of the box, or of the box around the cylinder, in metres."""
    centre: tuple[float, float, float]


TABLE = Block("table", "box", (0.60, 0.60, 0.04), (0.0, 0.0, -0.02))
"""Its top is the plane z = 0."""


def furniture(camera: Camera) -> tuple[Block, ...]:
    """Return the table, the camera, and the stand that carries it from behind."""
    x, y, z = camera.eye
    width = 2 * STAND_RADIUS
    behind = y - CAMERA_SIZE[1] / 2 - STAND_RADIUS
    return (
        TABLE,
        Block("camera", "box", CAMERA_SIZE, (x, y, z)),
        Block("camera stand", "cylinder", (width, width, z), (x, behind, z / 2)),
    )
