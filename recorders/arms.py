"""What a recorder asks of the two arms: their joints' names and where their links stand."""

from collections.abc import Mapping, Sequence
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from dnet.types import ARMS, Joints, Transform

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


def orientation_in_world(
    transforms: Sequence[Transform], child: str
) -> Float64[np.ndarray, "4"] | None:
    """Return how `child` is turned in the frame at the root, or None if it is not there."""
    parents: Mapping[str, Transform] = {entry.child: entry for entry in transforms}
    if child not in parents:
        return None
    rotation = Rotation.identity()
    seen = set[str]()
    while child in parents and child not in seen:
        seen.add(child)
        entry = parents[child]
        rotation = Rotation.from_quat(entry.rotation) * rotation
        child = entry.parent
    return np.asarray(rotation.as_quat(), dtype=np.float64)
