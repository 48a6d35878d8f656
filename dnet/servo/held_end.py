"""Whether a goal can be a shape of the object at hand: what the holding jaws grip stays there."""

import numpy as np

from dnet.geometry.chamfer import nearest_distances
from dnet.types import Cloud

REACH = 0.012
"""What is near the jaws, in metres: less than they hold of a box."""
SHARE = 0.9
"""Of the points there, how many must be near the goal; the others may bend away."""
LIMIT = 0.006
"""Above this the goal is hardly of this object, in metres. Of 80 goals of the box itself none was
above 4.8 mm; of 160 of a cylinder or a hemi-ellipsoid 156 were above 6 mm, and of 80 of a box
lying elsewhere 24."""


def held_end_apart(initial: Cloud, goal: Cloud, hold: tuple[float, float, float]) -> float:
    """Return how far the goal is from the object where the holding jaws grip it, in metres.

    Whatever the moving arm does, that end of the object stays as it is. The goal of another
    object, or of this one lying elsewhere, is not there, which networks that have seen pairs of
    one object alone do not notice.

    Args:
        initial: The object before the grasp, (n, 3).
        goal: The shape to reach, (m, 3).
        hold: Where the holding jaws grip, in the world.

    Returns:
        The 90th percentile of the distances to the goal of the points within 12 mm of the grip;
        0 if none of them is seen.
    """
    near = initial[np.linalg.norm(initial - np.array(hold), axis=1) < REACH]
    return float(np.quantile(nearest_distances(near, goal), SHARE)) if len(near) else 0.0
