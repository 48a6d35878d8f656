"""What a way to hold and grasp must do: take nodes, carry them along, say where the arms are."""

from typing import Literal, Protocol, runtime_checkable

from dnet.sim.soft_body import NodeIndices
from dnet.types import Joints

Drive = Literal["kinematic", "motor"]
"""`kinematic`: the arms are exactly where they are told; `motor`: they are driven there."""


@runtime_checkable
class Grip(Protocol):
    """Both arms' hold on a soft body: the first keeps it, the second carries it along."""

    @property
    def joints(self) -> tuple[Joints, Joints]:
        """Where the holding and the moving arm are, not where they were told to be."""
        ...

    @property
    def still(self) -> bool:
        """Whether both arms stand still."""
        ...

    def take(
        self, held: NodeIndices, gripped: NodeIndices, *, joints: tuple[Joints, Joints]
    ) -> None:
        """Put both arms at joint positions, and grip nodes as they lie.

        Args:
            held: What the holding arm grips.
            gripped: What the moving arm grips.
            joints: Of the holding and the moving arm.
        """
        ...

    def release(self) -> None:
        """Let go of every node."""
        ...

    def lead(self, joints: Joints) -> None:
        """Send the moving arm to joint positions, to be there after the next simulation step."""
        ...

    def show(self) -> None:
        """Make the arms' bodies stand where the arms are, for a camera to see."""
        ...
