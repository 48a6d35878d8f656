"""What decides the next motion of the gripper from the current and the goal cloud."""

from typing import Protocol, runtime_checkable

from dnet.types import Cloud, Point


@runtime_checkable
class Controller(Protocol):
    """Maps two clouds of one object to the motion that takes one shape to the other."""

    def predict(self, current: Cloud, goal: Cloud) -> Point:
        """Return the motion of the grasp, in metres, (3,).

        Args:
            current: What is seen now, in farthest-point order, (n, 3).
            goal: The shape to reach, likewise.
        """
        ...
