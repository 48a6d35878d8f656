"""Where a grasp takes an object straight from rest: foreseen before it moves, compared after."""

import numpy as np

from dnet.sim.grasp import Grasp
from dnet.sim.quasistatic import QuasistaticSolver
from dnet.sim.tetrahedra import Vertices
from dnet.types import Point, Tissue


class Foresight:
    """A second opinion on the shapes of one grasp, by the quasi-static solver."""

    def __init__(self, start: Grasp, tissue: Tissue) -> None:
        """Take the object at rest, with both arms on it."""
        self._start = start
        self.solver = QuasistaticSolver(start.mesh, young=tissue.young, poisson=tissue.poisson)
        """It holds the nodes that the arms grip."""
        self.solver.hold(start.pinned)

    def least_volume_ratio(self, displacement: Point) -> float:
        """Return the least ratio of a tetrahedron's volume to its rest volume after a motion.

        Args:
            displacement: Of what the moving arm grips, from rest, in metres.
        """
        rest = self._start.rest
        moved = rest[self._start.gripped] + displacement
        targets = np.concatenate([rest[self._start.held], moved])
        foreseen = self.solver.settle(rest, targets)
        return float(self._start.mesh.volume_ratios(foreseen.nodes).min())

    def deviation(self, nodes: Vertices) -> float:
        """Return how far a settled shape is from the one that its grasp reaches straight from rest.

        Args:
            nodes: Of the settled shape, in metres, (n, 3).

        Returns:
            Distance of the worst node in metres.
        """
        straight = self.solver.settle(self._start.rest, nodes[self._start.pinned])
        return float(np.linalg.norm(nodes - straight.nodes, axis=1).max())
