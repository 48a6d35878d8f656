"""A soft body in Bullet: loading it, pinning or anchoring nodes, moving them, stopping them."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float64, Int64

from dnet.sim.bullet import pybullet, quiet
from dnet.sim.bullet_mesh import reset_nodes
from dnet.sim.material import stable_neo_hookean
from dnet.sim.tetrahedra import TetrahedralMesh, Vertices, to_vtk

DAMPING = 0.01
"""Bullet's Neo-Hookean damping: less never settles, more costs time."""
COLLISION_MARGIN = 1e-4
"""In metres; contact is off, and a larger margin would inflate what the camera sees."""

NodeIndices = Int64[np.ndarray, "_"]


class SoftBody:
    """An elastic body whose nodes can be pinned and carried along.

    A pinned node is one whose mass Bullet sets to zero: it stays where it is put. An anchored one
    goes with a link of another body, and pulls at it.
    """

    def __init__(
        self,
        client: int,
        mesh: TetrahedralMesh,
        *,
        young: float,
        poisson: float,
        density: float,
    ) -> None:
        """Load the body at its rest shape, in a deformable world without gravity.

        Args:
            client: Bullet's physics client.
            mesh: Rest shape in metres.
            young: Young's modulus in pascals.
            poisson: Poisson's ratio.
            density: In kg/m^3.
        """
        self.mesh = mesh
        self._client = client
        mu, lam = stable_neo_hookean(young, poisson)
        with tempfile.TemporaryDirectory() as folder, quiet():
            path = Path(folder) / "body.vtk"
            path.write_text(to_vtk(mesh))
            self.body: int = pybullet.loadSoftBody(
                str(path),
                mass=density * float(mesh.volumes(mesh.nodes).sum()),
                useNeoHookean=1,
                NeoHookeanMu=mu,
                NeoHookeanLambda=lam,
                NeoHookeanDamping=DAMPING,
                # Bullet reads the springs' stiffness even where there are none: if it is not
                # set here, it is what an earlier command left at that place in memory.
                useMassSpring=1,
                springElasticStiffness=0,
                springDampingStiffness=0,
                springBendingStiffness=0,
                collisionMargin=COLLISION_MARGIN,
                useSelfCollision=0,
                useFaceContact=0,
                repulsionStiffness=0,
                physicsClientId=client,
            )
        self._wake()
        self._grips: list[int] = []

    def nodes(self) -> Vertices:
        """Return where the nodes are, in metres, (n, 3)."""
        return np.array(self._read(), dtype=np.float64)

    def pin(self, nodes: NodeIndices) -> None:
        """Hold nodes where they are."""
        # No body stands for a pin.
        self.anchor(nodes, body=-1, link=-1)

    def anchor(self, nodes: NodeIndices, *, body: int, link: int) -> None:
        """Fix nodes, as they lie now, to a link of another body, which must have a solid shape."""
        for node in nodes:
            self._grips.append(
                pybullet.createSoftBodyAnchor(
                    self.body, int(node), body, link, physicsClientId=self._client
                )
            )

    def release(self) -> None:
        """Let go of every pinned or anchored node; a pinned one gets its mass back."""
        for grip in self._grips:
            pybullet.removeConstraint(grip, physicsClientId=self._client)
        self._grips.clear()

    def place(self, nodes: Sequence[int] | NodeIndices, where: Float64[np.ndarray, "_ 3"]) -> None:
        """Put nodes at given positions and leave the others where they are."""
        positions = list(self._read())
        for node, position in zip(nodes, where.tolist(), strict=True):
            positions[node] = position
        reset_nodes(self.body, positions, client=self._client)

    def stop(self) -> None:
        """Set every node's velocity to zero: Bullet does so to a body that falls asleep."""
        pybullet.changeDynamics(
            self.body,
            -1,
            activationState=pybullet.ACTIVATION_STATE_SLEEP,
            physicsClientId=self._client,
        )
        pybullet.stepSimulation(physicsClientId=self._client)
        self._wake()

    def _wake(self) -> None:
        # A body left to itself falls asleep after 2 s, and moving a pinned node does not wake it.
        pybullet.changeDynamics(
            self.body,
            -1,
            activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            physicsClientId=self._client,
        )

    def _read(self) -> Sequence[Sequence[float]]:
        # Without the flag Bullet returns the vertices it draws, which are not the nodes.
        _, nodes = pybullet.getMeshData(
            self.body,
            -1,
            flags=pybullet.MESH_DATA_SIMULATION_MESH,
            physicsClientId=self._client,
        )
        return nodes
