"""What planning needs of an arm and of the space around it."""

from collections.abc import Callable
from typing import Protocol, runtime_checkable

import numpy as np

from dnet.errors import Unreachable
from dnet.types import JointPath, Joints, Pose, Poses

METRES_PER_UNIT = np.array([0.16, 0.16, 1.0, 0.012, 0.019, 0.010])
"""How far the tip moves per radian or metre of each joint: its lever arm in the middle of the
workspace, in metres. Distances in joint space are measured in these, so that a step means the
same for every joint; unscaled, one percent of the space is an 83 mm stroke of the insertion."""


FirstObstacle = Callable[[JointPath], tuple[int, str] | None]
"""The first row of a path at which an arm would touch something, and what, with which link; None
if all of it is clear."""


@runtime_checkable
class Arm(Protocol):
    """An arm of six joints with a solution to its inverse kinematics."""

    @property
    def lower(self) -> Joints:
        """Least joint positions."""
        ...

    @property
    def upper(self) -> Joints:
        """Greatest joint positions."""
        ...

    @property
    def velocity(self) -> Joints:
        """Greatest joint velocities."""
        ...

    @property
    def acceleration(self) -> Joints:
        """Greatest joint accelerations."""
        ...

    def forward(self, joints: Joints) -> Pose:
        """Return the pose of the tip in the world."""
        ...

    def forward_along(self, path: JointPath) -> Poses:
        """Return the pose of the tip at every row of a joint path."""
        ...

    def inverse(self, tip: Pose, *, near: Joints) -> Joints:
        """Return joint positions for a pose of the tip, the nearest to `near`.

        Raises:
            Unreachable: If there are none within the limits.
        """
        ...

    def inverse_along(self, tips: Poses, *, near: Joints) -> tuple[JointPath, Unreachable | None]:
        """Return joint positions for poses that follow each other, each the nearest to the last.

        They end before the first pose that cannot be reached, and why it cannot is returned too.
        """
        ...


@runtime_checkable
class Surroundings(Protocol):
    """What the moving arm must stay clear of."""

    def stand(self, holding: Joints) -> None:
        """Take note of where the holding arm stands."""
        ...

    def obstacle(self, joints: Joints) -> str | None:
        """Return what the arm would touch at `joints` and with which link, or None."""
        ...

    def first_obstacle(self, path: JointPath) -> tuple[int, str] | None:
        """Return the first row of a path at which there is an obstacle, and which."""
        ...
