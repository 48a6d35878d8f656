"""PyBullet against an independent solver: how far apart are the shapes of the same pulls?"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64

from dnet.sim.quasistatic import QuasistaticSolver
from dnet.sim.rollout import LARGEST_DEVIATION
from dnet.sim.tissue import tissue_mesh
from dnet.tools.material_pulls import pulls
from dnet.types import Tissue

Errors = Float64[np.ndarray, "shapes nodes"]


@dataclass(frozen=True, eq=False)
class Agreement:
    """Node errors of settled shapes, in millimetres."""

    motion_mm: Float64[np.ndarray, "shapes"]
    """How far the gripper pulled."""
    from_rest: Errors
    """Distance of PyBullet's nodes from those that the solver finds straight from rest."""
    from_shape: Errors
    """The same where the solver starts from PyBullet's shape: how far that is from the nearest
    equilibrium."""
    rejected: Counter[str]
    """Pulls drawn again, by reason; those left out as the solver found no equilibrium: unsolved."""

    @property
    def bistable(self) -> Bool[np.ndarray, "shapes"]:
        """Which pulls allow several shapes: both solvers are at rest, in different ones."""
        apart = 1e-3 * self.from_rest.max(axis=1) > LARGEST_DEVIATION
        at_rest = 1e-3 * self.from_shape.max(axis=1) <= LARGEST_DEVIATION
        return apart & at_rest


def compare(
    tissue: Tissue,
    shapes: int,
    *,
    seed: int,
    reference: Tissue | None = None,
    advance: Callable[[], object] = lambda: None,
) -> Agreement:
    """Pull the object about at random in PyBullet, and ask the solver for the same shapes.

    Args:
        tissue: The object.
        shapes: How many shapes.
        seed: Of the scenes and the displacements.
        reference: The object whose material the solver takes, by default the same.
        advance: Called after each shape.

    Raises:
        NoValidShape: If too many draws in a row are rejected.
    """
    material = reference or tissue
    solver = QuasistaticSolver(tissue_mesh(tissue), young=material.young, poisson=material.poisson)
    rejected: Counter[str] = Counter()
    motion: list[float] = []
    from_rest: list[np.ndarray] = []
    from_shape: list[np.ndarray] = []
    for pull in pulls(tissue, shapes, seed=seed, rejected=rejected):
        advance()
        # The nodes are those of the world: the energy does not care how a body lies.
        solver.hold(pull.pinned)
        targets = pull.nodes[pull.pinned]
        found = [solver.settle(start, targets) for start in (pull.rest, pull.nodes)]
        if not all(equilibrium.converged for equilibrium in found):
            rejected["unsolved"] += 1
            continue
        motion.append(1e3 * float(np.linalg.norm(pull.displacement)))
        for equilibrium, errors in zip(found, (from_rest, from_shape), strict=True):
            errors.append(1e3 * np.linalg.norm(pull.nodes - equilibrium.nodes, axis=1))
    return Agreement(np.array(motion), np.array(from_rest), np.array(from_shape), rejected)
