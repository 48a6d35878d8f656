"""Shapes at rest are those of the energy, of an independent solver, and of Bullet."""

import subprocess
import sys
from contextlib import closing
from dataclasses import dataclass

import numpy as np
import pytest

from dnet.errors import TooFew
from dnet.geometry.pose import rotation_z
from dnet.sim.bullet import pybullet, start_server
from dnet.sim.elastic_energy import elements, energy_and_gradient
from dnet.sim.material import stable_neo_hookean
from dnet.sim.quasistatic import Equilibrium, QuasistaticSolver
from dnet.sim.soft_body import SoftBody
from dnet.sim.tetrahedra import TetrahedralMesh, Vertices, box_mesh
from tests.sim.oracle import Oracle

MESH = box_mesh((0.1, 0.1, 0.04), (8, 8, 4))
YOUNG, POISSON = 1000.0, 0.3
MATERIAL = stable_neo_hookean(YOUNG, POISSON)


@dataclass(frozen=True, eq=False)
class Pull:
    """The box held at one end face and moved where it is gripped on top."""

    held: np.ndarray
    gripped: np.ndarray
    displacement: np.ndarray

    @property
    def pinned(self) -> np.ndarray:
        return np.concatenate([self.held, self.gripped])

    def targets(self, share: float = 1.0) -> Vertices:
        end = MESH.nodes[self.gripped] + share * self.displacement
        return np.concatenate([MESH.nodes[self.held], end])


def pull(seed: int) -> Pull:
    random = np.random.default_rng(seed)
    point = np.array([random.uniform(0.02, 0.045), random.uniform(-0.04, 0.04), 0.02])
    return Pull(
        held=np.flatnonzero(MESH.nodes[:, 0] <= MESH.nodes[:, 0].min() + 1e-9),
        gripped=np.flatnonzero(np.linalg.norm(MESH.nodes - point, axis=1) < 0.016),
        displacement=random.uniform((-0.03, -0.05, 0.0), (0.05, 0.05, 0.05)),
    )


def solver(pinned: np.ndarray) -> QuasistaticSolver:
    made = QuasistaticSolver(MESH, young=YOUNG, poisson=POISSON)
    made.hold(pinned)
    return made


def settled(pulled: Pull) -> Equilibrium:
    return solver(pulled.pinned).settle(MESH.nodes, pulled.targets())


def farthest(one: Vertices, other: Vertices) -> float:
    return float(np.linalg.norm(one - other, axis=1).max())


def come_to_rest_in_bullet(client: int, mesh: TetrahedralMesh, pulled: Pull) -> Vertices:
    pybullet.resetSimulation(pybullet.RESET_USE_DEFORMABLE_WORLD, physicsClientId=client)
    pybullet.setGravity(0, 0, 0, physicsClientId=client)
    pybullet.setTimeStep(7e-3, physicsClientId=client)
    body = SoftBody(client, mesh, young=YOUNG, poisson=POISSON, density=1000.0)
    body.pin(pulled.pinned)
    count = int(np.ceil(np.linalg.norm(pulled.displacement) / 0.2 / 7e-3))
    for step in range(1, count + 1):
        body.place(pulled.pinned, pulled.targets(step / count))
        pybullet.stepSimulation(physicsClientId=client)
    moved = np.inf
    while moved > 5e-5:
        before = body.nodes()
        for _ in range(20):
            pybullet.stepSimulation(physicsClientId=client)
        moved = np.abs(body.nodes() - before).max()
        body.stop()
    return body.nodes()


class Server:
    def __init__(self) -> None:
        self.client = start_server()

    def close(self) -> None:
        pybullet.disconnect(physicsClientId=self.client)


@pytest.mark.parametrize("seed", range(4))
def test_shapes_agree_with_an_independent_solver(seed: int) -> None:
    pulled = pull(seed)
    found = settled(pulled)
    oracle = Oracle(MESH, mu=MATERIAL.mu, lam=MATERIAL.lam)
    expected = oracle.settle(MESH.nodes, pulled.pinned, pulled.targets())
    assert found.converged
    assert np.linalg.norm(found.nodes - expected, axis=1).mean() < 2e-5
    assert farthest(found.nodes, expected) < 1e-4
    assert farthest(found.nodes, MESH.nodes) > 0.02


def test_shapes_agree_with_those_to_which_bullet_settles() -> None:
    with closing(Server()) as server:
        for seed in range(10, 16):
            pulled = pull(seed)
            bullet = come_to_rest_in_bullet(server.client, MESH, pulled)
            error = np.linalg.norm(settled(pulled).nodes - bullet, axis=1)
            print(f"mean {error.mean() * 1e3:.3f} mm, worst {error.max() * 1e3:.3f} mm")
            assert error.mean() < 0.5e-3


@pytest.mark.parametrize("seed", range(20, 25))
def test_a_free_node_at_rest_feels_no_force(seed: int) -> None:
    pulled = pull(seed)
    points = np.ascontiguousarray(settled(pulled).nodes.T)
    gradient = np.empty_like(points)
    energy_and_gradient(points, elements(MESH, MATERIAL), gradient)
    free = np.setdiff1d(np.arange(len(MESH.nodes)), pulled.pinned)
    assert np.abs(gradient[:, free]).max() < 1e-3 * np.abs(gradient).max()


def test_pinned_nodes_are_exactly_at_their_targets() -> None:
    pulled = pull(0)
    np.testing.assert_array_equal(settled(pulled).nodes[pulled.pinned], pulled.targets())


def test_a_body_that_is_not_moved_stays_as_it_is() -> None:
    pulled = pull(0)
    found = solver(pulled.pinned).settle(MESH.nodes, pulled.targets(0.0))
    assert found.converged
    assert farthest(found.nodes, MESH.nodes) < 1e-9


def test_a_body_that_is_carried_keeps_its_shape() -> None:
    """The pinned nodes turn and shift together, and so does the rest of the body."""
    pulled = pull(1)
    turn, shift = rotation_z(0.5), np.array([0.03, -0.02, 0.05])
    carried = MESH.nodes @ turn.T + shift
    found = solver(pulled.pinned).settle(MESH.nodes, carried[pulled.pinned])
    assert found.converged
    assert farthest(found.nodes, carried) < 1e-5


def test_the_shape_turns_with_the_scene() -> None:
    pulled = pull(2)
    turn = rotation_z(0.7)
    found = solver(pulled.pinned).settle(MESH.nodes @ turn.T, pulled.targets() @ turn.T)
    assert farthest(found.nodes, settled(pulled).nodes @ turn.T) < 1e-5


@pytest.mark.parametrize("seed", range(30, 34))
def test_the_shape_does_not_depend_on_the_way(seed: int) -> None:
    """For motions of up to four centimetres, where the equilibrium is the only one near."""
    drawn = pull(seed)
    pulled = Pull(drawn.held, drawn.gripped, drawn.displacement / 2)
    found = solver(pulled.pinned)
    detour = pulled.targets() + np.where(
        np.isin(pulled.pinned, pulled.gripped)[:, None], [0.01, 0.02, 0.02], 0.0
    )
    there = found.settle(MESH.nodes, detour).nodes
    back = found.settle(there, pulled.targets()).nodes
    assert farthest(back, settled(pulled).nodes) < 5e-5


def test_pushing_far_inwards_still_ends_at_rest() -> None:
    """Where the energy law is strange, tetrahedra turn inside out, but nothing breaks."""
    drawn = pull(3)
    pushed = Pull(drawn.held, drawn.gripped, np.array([-0.05, 0.0, -0.03]))
    found = settled(pushed)
    assert found.converged
    assert MESH.volume_ratios(found.nodes).min() < 0


def test_the_same_motion_gives_the_same_bytes() -> None:
    pulled = pull(4)
    one, other = settled(pulled), settled(pulled)
    assert one.nodes.tobytes() == other.nodes.tobytes()
    assert one.iterations == other.iterations


def test_what_is_held_can_be_changed() -> None:
    first, second = pull(5), pull(6)
    found = solver(first.pinned)
    found.settle(MESH.nodes, first.targets())
    found.hold(second.pinned)
    again = found.settle(MESH.nodes, second.targets())
    assert again.nodes.tobytes() == settled(second).nodes.tobytes()


def test_a_body_all_of_whose_nodes_are_pinned_goes_where_they_go() -> None:
    every = np.arange(len(MESH.nodes))
    found = solver(every).settle(MESH.nodes, MESH.nodes + 0.02)
    assert found.converged
    np.testing.assert_array_equal(found.nodes, MESH.nodes + 0.02)


def test_a_body_adrift_is_refused() -> None:
    with pytest.raises(TooFew, match="pinned nodes is 0"):
        solver(np.zeros(0, dtype=np.int64))


INTERRUPTED = """
import signal
import numpy as np
from dnet.sim.quasistatic import QuasistaticSolver
from dnet.sim.tetrahedra import box_mesh

mesh = box_mesh((0.1, 0.1, 0.04), (8, 8, 4))
end, other = (np.flatnonzero(mesh.nodes[:, 0] == side) for side in (-0.05, 0.05))
solver = QuasistaticSolver(mesh, young=1000.0, poisson=0.3)
solver.hold(np.concatenate([end, other]))
targets = np.concatenate([mesh.nodes[end], mesh.nodes[other] + [0.03, 0.02, 0.02]])
solver.settle(mesh.nodes, targets)
signal.signal(signal.SIGALRM, signal.default_int_handler)
interrupted = 0
while interrupted < 200:
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.001 + interrupted % 10 * 1e-4)
        while True:
            solver.settle(mesh.nodes, targets)
    except KeyboardInterrupt:
        interrupted += 1
print("survived")
"""


def test_ctrl_c_interrupts_a_kernel_without_a_crash() -> None:
    ran = subprocess.run(
        [sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stderr
    assert "survived" in ran.stdout
