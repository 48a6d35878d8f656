"""A soft body that Bullet only draws: the surface of a mesh, put where its nodes are."""

import tempfile
from pathlib import Path

import numpy as np

from dnet.sim.bullet import pybullet, quiet
from dnet.sim.bullet_mesh import reset_nodes
from dnet.sim.tetrahedra import TetrahedralMesh, Vertices


class SoftPicture:
    """The surface of a mesh as cloth without any stiffness: nothing moves it but `show`."""

    def __init__(self, client: int, mesh: TetrahedralMesh) -> None:
        """Load the surface into a deformable world without gravity.

        Args:
            client: Bullet's physics client.
            mesh: Whose surface; where its nodes are, `show` says.
        """
        self._client = client
        self._shown, corners = np.unique(mesh.surface(), return_inverse=True)
        triangles = corners.reshape(-1, 3) + 1
        with tempfile.TemporaryDirectory() as folder, quiet():
            path = Path(folder) / "surface.obj"
            path.write_text(
                "".join(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in mesh.nodes[self._shown])
                + "".join(f"f {a} {b} {c}\n" for a, b, c in triangles)
            )
            self.body: int = pybullet.loadSoftBody(
                str(path),
                useMassSpring=1,
                springElasticStiffness=0,
                springDampingStiffness=0,
                springBendingStiffness=0,
                collisionMargin=1e-4,
                useSelfCollision=0,
                useFaceContact=0,
                repulsionStiffness=0,
                physicsClientId=client,
            )

    def show(self, nodes: Vertices) -> None:
        """Put the surface where the nodes are: Bullet draws that only after a step."""
        reset_nodes(self.body, nodes[self._shown].tolist(), client=self._client)
        pybullet.stepSimulation(physicsClientId=self._client)
