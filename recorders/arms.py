"""What a recorder asks of the two arms: their joints' names and where their links stand."""

from collections.abc import Mapping, Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64

from dnet.types import ARMS, JointPath, Joints, LinkWay, Transform

Quaternion = tuple[float, float, float, float]

TIP = f"{ARMS[1]}/tip_link"
"""The frame at the tip of the moving arm's jaws."""


@runtime_checkable
class ArmModel(Protocol):
    """Both arms, as far as a log draws them."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the six joints of one arm, such as "yaw"."""
        ...

    def transforms(self, joints: tuple[Joints, Joints]) -> Sequence[Transform]:
        """Return every link of both arms in its parent; a child is named arm + "/" + link."""
        ...


@runtime_checkable
class MovingArms(ArmModel, Protocol):
    """Both arms, as far as a viewer follows them on their way."""

    def links(self, joints: tuple[Joints, Joints]) -> LinkWay:
        """Return the same as `transforms`, at this one time."""
        ...

    def way(self, path: JointPath) -> LinkWay:
        """Return those links of the moving arm that move, at every row of a joint path."""
        ...


def orientation_in_world(
    transforms: Sequence[Transform], child: str
) -> Float64[np.ndarray, "4"] | None:
    """Return how `child` is turned in the frame at the root, or None if it is not there."""
    parents: Mapping[str, Transform] = {entry.child: entry for entry in transforms}
    if child not in parents:
        return None
    turn = (0.0, 0.0, 0.0, 1.0)
    seen = set[str]()
    while child in parents and child not in seen:
        seen.add(child)
        entry = parents[child]
        x, y, z, w = entry.rotation.tolist()
        turn = _after((x, y, z, w), turn)
        child = entry.parent
    result = np.array(turn)
    return result / np.linalg.norm(result)


def _after(second: Quaternion, first: Quaternion) -> Quaternion:
    """Return the product of two quaternions, x y z w: `first`, then `second`."""
    # A dozen products of single numbers: numpy would take ten times as long.
    a, b, c, d = second
    x, y, z, w = first
    return (
        d * x + a * w + b * z - c * y,
        d * y + b * w + c * x - a * z,
        d * z + c * w + a * y - b * x,
        d * w - a * x - b * y - c * z,
    )
