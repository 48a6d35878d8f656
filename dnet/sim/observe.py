"""One look at a world, as the frame that logs and networks take."""

from collections.abc import Callable

import numpy as np
from jaxtyping import UInt8

from dnet.geometry.camera import DepthImage
from dnet.sim.world import World
from dnet.types import Cloud, Frame, FrameKind, Look

See = Callable[[DepthImage, int], Cloud]
"""From a depth image and the object's number in its mask to the object's cloud."""
Noise = Callable[[DepthImage], DepthImage]
"""From what an ideal camera sees to what a real one gives."""


def observe(
    world: World, see: See, kind: FrameKind, *, image: bool = False, noise: Noise | None = None
) -> Frame:
    """Return what is seen now, and where the arms and the grasp are.

    Args:
        world: What is looked at.
        see: From the image to the cloud.
        kind: What the frame is.
        image: Whether the frame keeps the image that its cloud was made from.
        noise: What the camera adds to it.
    """
    seen = world.look()
    if noise is not None:
        seen = noise(seen)
    return Frame(
        time=world.time,
        kind=kind,
        cloud=see(seen, world.object_id),
        grasp=world.tip,
        joints=world.joints,
        nodes=world.nodes(),
        image=Look(seen.depth, _shown(seen, world.object_id)) if image else None,
    )


def _shown(image: DepthImage, object_id: int) -> UInt8[np.ndarray, "h w"]:
    """Return the mask with the numbers of `Look`: those of the simulator depend on its order."""
    mask = image.mask
    others = np.where(mask > object_id, mask + 1, mask + 2)
    numbers = np.where(mask == object_id, 1, np.where(mask < 0, 0, others))
    return np.minimum(numbers, 255).astype(np.uint8)
