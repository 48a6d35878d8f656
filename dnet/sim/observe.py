"""One look at a world, as the frame that logs and networks take."""

from collections.abc import Callable

from dnet.geometry.camera import DepthImage
from dnet.sim.world import World
from dnet.types import Cloud, Frame, FrameKind

See = Callable[[DepthImage, int], Cloud]
"""From a depth image and the object's number in its mask to the object's cloud."""


def observe(world: World, see: See, kind: FrameKind) -> Frame:
    """Return what is seen now, and where the arms and the grasp are."""
    return Frame(
        time=world.time,
        kind=kind,
        cloud=see(world.look(), world.object_id),
        grasp=world.tip,
        joints=world.joints,
        nodes=world.nodes(),
    )
