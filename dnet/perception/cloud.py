"""From a depth image to the partial cloud of the object that a network sees."""

from dnet.geometry.camera import DepthImage, unproject
from dnet.geometry.sampling import farthest_points
from dnet.types import Cloud

POINTS = 2048
"""Points of a cloud, as in the paper."""


def object_cloud(image: DepthImage, object_id: int, *, points: int = POINTS) -> Cloud:
    """Return the visible surface of one body, evenly sampled, in farthest-point order.

    Segmentation comes with the image: the mask says which pixels show the object, and robot and
    background drop out.

    Args:
        image: What the camera saw.
        object_id: The object's number in the mask.
        points: How many points to keep.

    Raises:
        ShortCloud: If fewer pixels than that show the object.
    """
    return farthest_points(unproject(image, image.mask == object_id), points)
