"""Where a soft body comes to rest: its elastic energy minimised as the pinned nodes are moved."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64
from scipy.sparse import csr_array
from scipy.sparse.csgraph import reverse_cuthill_mckee

from dnet.errors import TooFew
from dnet.sim.elastic_energy import Components, elements
from dnet.sim.envelope import factorised, solve
from dnet.sim.material import lame, stable_neo_hookean
from dnet.sim.quasi_newton import Descent, Limits, empty_memory, minimise
from dnet.sim.tetrahedra import TetrahedralMesh, Vertices

INCREMENT = 0.008
"""Largest move of a pinned node between two equilibria, in metres: small enough to stay on the
branch of equilibria that a slow motion follows."""
ON_THE_WAY = 5e-4
"""Tolerance of the equilibria between, in metres."""
TOLERANCE = 1e-6
"""Tolerance of the last one: the next step would move no node farther, in metres."""
PATIENCE = 1000
"""Iterations for one increment, after which it is given up."""


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A shape at rest, and how it was found."""

    nodes: Vertices
    """In metres, (n, 3)."""
    converged: bool
    """Whether the residual is below the tolerance."""
    iterations: int
    """Quasi-Newton steps over all increments."""
    residual: float
    """How far the next step would move the node that it moves farthest, in metres."""


class QuasistaticSolver:
    """Finds equilibria of a body without gravity whose pinned nodes are moved slowly.

    The energy is the one that Bullet's soft body has, so that the shapes are those to which
    `BulletWorld` comes to rest.
    """

    def __init__(self, mesh: TetrahedralMesh, *, young: float, poisson: float) -> None:
        """Take a body at its rest shape.

        Args:
            mesh: Rest shape in metres.
            young: Young's modulus in pascals.
            poisson: Poisson's ratio.
        """
        self._mesh = mesh
        self._material = stable_neo_hookean(young, poisson)
        self._stiffness = _laplacian(mesh, young=young, poisson=poisson)

    def hold(self, pinned: Int64[np.ndarray, "_"]) -> None:
        """Say which nodes are pinned, instead of those before, and factorise for the others.

        Raises:
            TooFew: If no node is pinned: a body adrift has no one place to rest.
        """
        if not len(pinned):
            raise TooFew("number of pinned nodes", 0, 1)
        every = np.arange(len(self._mesh.nodes))
        free = np.setdiff1d(every, pinned)
        if len(free):
            among_free = self._stiffness[free][:, free]
            free = free[reverse_cuthill_mckee(among_free, symmetric_mode=True)]
        # The kernels want the free nodes first, and neighbours near to each other.
        self._order = np.concatenate([free, pinned])
        place = np.empty_like(every)
        place[self._order] = every
        tetrahedra = place[self._mesh.tetrahedra]
        tetrahedra = tetrahedra[np.argsort(tetrahedra.min(axis=1), kind="stable")]
        mesh = TetrahedralMesh(self._mesh.nodes[self._order], tetrahedra)
        self._body = elements(mesh, self._material)
        self._factor = factorised(self._stiffness[free][:, free])
        self._coupling = self._stiffness[free][:, pinned]

    def settle(self, nodes: Vertices, targets: Float64[np.ndarray, "_ 3"]) -> Equilibrium:
        """Move the pinned nodes in straight lines from where they are to their targets.

        Args:
            nodes: Where all nodes are, in metres, (n, 3).
            targets: Where the pinned nodes go, in the order in which `hold` was given them.
        """
        return self.follow(nodes, targets[None])

    def follow(self, nodes: Vertices, way: Float64[np.ndarray, "_ _ 3"]) -> Equilibrium:
        """Move the pinned nodes through one place after another, and rest at the last.

        Args:
            nodes: Where all nodes are, in metres, (n, 3).
            way: Where the pinned nodes go, in metres, (places, pinned, 3); straight in between.
        """
        free = len(self._factor.first)
        points = np.ascontiguousarray(nodes[self._order].T)
        memory = empty_memory(free)
        change, moved = np.zeros((3, free)), np.zeros((3, len(self._order) - free))
        descents: list[Descent] = []
        places = [*_increments(points[:, free:], way)]
        for place in places:
            # What the last increment did, corrected for the difference by the small-strain answer.
            before, last_moved = points.copy(), moved
            moved = place - points[:, free:]
            points[:, :free] += change + self._pulled_along(moved - last_moved)
            points[:, free:] = place
            limits = Limits(TOLERANCE if place is places[-1] else ON_THE_WAY, PATIENCE)
            descents.append(Descent(*minimise(points, self._body, self._factor, memory, limits)))
            change = points[:, :free] - before[:, :free]
        settled = np.empty_like(nodes)
        settled[self._order] = points.T
        return Equilibrium(
            nodes=settled,
            converged=descents[-1].converged,
            iterations=sum(descent.iterations for descent in descents),
            residual=descents[-1].residual,
        )

    def _pulled_along(self, moved: Components) -> Components:
        """Return how the free nodes follow the pinned ones at small strain, (3, free)."""
        change = -np.ascontiguousarray((self._coupling @ moved.T).T)
        solve(self._factor, change)
        return change


def _increments(start: Components, way: Float64[np.ndarray, "_ _ 3"]) -> Iterator[Components]:
    """Yield places along the way, no node farther than an increment from one to the next."""
    ends = way.transpose(0, 2, 1)
    for number, end in enumerate(ends, start=1):
        # A place is left out if the one after it can be reached at once.
        if number < len(ends) and _farthest(ends[number] - start) <= INCREMENT:
            continue
        count = max(1, int(np.ceil(_farthest(end - start) / INCREMENT)))
        for step in range(1, count):
            yield start + (end - start) * (step / count)
        yield end
        start = end


def _farthest(moved: Components) -> float:
    return float(np.linalg.norm(moved, axis=0).max())


def _laplacian(mesh: TetrahedralMesh, *, young: float, poisson: float) -> csr_array:
    """Return a stiffness for each coordinate alone, in N/m.

    Linear finite elements of the Laplacian, weighted with the P-wave modulus lambda + 2 mu: the
    greatest stiffness of the material at small strain. It does not change as the body turns.
    """
    mu, lam = lame(young, poisson)
    inverse = np.linalg.inv(mesh.edges(mesh.nodes))
    slopes = np.concatenate([-inverse.sum(axis=1, keepdims=True), inverse], axis=1)
    weight = (lam + 2 * mu) * mesh.volumes(mesh.nodes)
    local = weight[:, None, None] * (slopes @ slopes.transpose(0, 2, 1))
    row = np.repeat(mesh.tetrahedra, 4, axis=1).ravel()
    column = np.tile(mesh.tetrahedra, 4).ravel()
    size = len(mesh.nodes)
    return csr_array((local.ravel(), (row, column)), shape=(size, size))
