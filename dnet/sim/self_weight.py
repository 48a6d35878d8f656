"""A body in PyBullet that hangs by some of its nodes: where its own weight brings it to rest."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from dnet.errors import Unsettled
from dnet.sim.bullet import pybullet, start_server
from dnet.sim.material import wave_speed
from dnet.sim.soft_body import NodeIndices, SoftBody
from dnet.sim.tetrahedra import TetrahedralMesh, Vertices

COURANT = 1.5
"""Time step as a multiple of the least altitude of a tetrahedron over the speed of sound."""
BLOCK = 5
"""Steps between two looks at how fast the body moves."""
TOLERANCE = 1e-5
"""The body rests when no node moves farther in a block at its fastest, as a share of how far it
has come."""
PATIENCE = 20000
"""Steps after which settling is given up."""


@dataclass(frozen=True, eq=False)
class Hanging:
    """A body at rest under its own weight."""

    nodes: Vertices
    """In metres, (n, 3)."""
    node_weight: float
    """What each node weighs, in newtons. Bullet gives all nodes the same mass, those of the
    surface too, which stand for less volume than those within."""
    steps: int
    """Simulation steps that it took."""


def hang(
    mesh: TetrahedralMesh,
    held: NodeIndices,
    gravity: Float64[np.ndarray, "3"],
    *,
    young: float,
    poisson: float,
    density: float,
) -> Hanging:
    """Return where a body comes to rest when gravity is switched on and some nodes are held.

    Its velocities are set to zero whenever its kinetic energy has passed a peak (kinetic damping:
    Barnes 1999, Form finding and analysis of tension structures by dynamic relaxation): slow
    bending comes to rest in a few swings, which the material's own damping would take minutes for.

    Args:
        mesh: Rest shape in metres.
        held: Nodes that stay where they are.
        gravity: In m/s^2.
        young: Young's modulus in pascals.
        poisson: Poisson's ratio.
        density: In kg/m^3.

    Raises:
        Unsettled: If it does not come to rest.
    """
    client = start_server()
    try:
        pybullet.resetSimulation(pybullet.RESET_USE_DEFORMABLE_WORLD, physicsClientId=client)
        x, y, z = gravity.tolist()
        pybullet.setGravity(x, y, z, physicsClientId=client)
        time_step = COURANT * mesh.least_altitude() / wave_speed(young, poisson, density)
        pybullet.setTimeStep(time_step, physicsClientId=client)
        pybullet.setPhysicsEngineParameter(sparseSdfVoxelSize=0.25, physicsClientId=client)
        body = SoftBody(client, mesh, young=young, poisson=poisson, density=density)
        body.pin(held)
        nodes, steps = _settle(body, client)
    finally:
        pybullet.disconnect(physicsClientId=client)
    mass = density * float(mesh.volumes(mesh.nodes).sum())
    return Hanging(nodes, mass * float(np.linalg.norm(gravity)) / len(nodes), steps)


def _settle(body: SoftBody, client: int) -> tuple[Vertices, int]:
    rest = before = body.nodes()
    fastest, farthest, steps = 0.0, np.inf, 0
    while steps < PATIENCE and not np.isnan(farthest):
        for _ in range(BLOCK):
            pybullet.stepSimulation(physicsClientId=client)
        steps += BLOCK
        nodes = body.nodes()
        speed = float(((nodes - before) ** 2).sum())
        farthest = float(np.abs(nodes - before).max())
        before = nodes
        if speed > fastest:
            fastest = speed
        elif farthest <= TOLERANCE * np.abs(nodes - rest).max():
            return nodes, steps
        else:
            body.stop()
            before = body.nodes()
            fastest, steps = 0.0, steps + 1
    raise Unsettled("a body under its own weight", steps, farthest)
