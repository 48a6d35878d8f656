"""Where a grasp takes an object straight from rest: foreseen before it moves, compared after."""

import numpy as np

from dnet.sim.grasp import Grasp
from dnet.sim.quasistatic import QuasistaticSolver
from dnet.sim.tetrahedra import Vertices
from dnet.types import Point, Tissue

LEAST_VOLUME_RATIO = 0.05
"""A shape with a tetrahedron squeezed below this share of its volume is not one of tissue."""
STRIDE = 0.008
"""Between two shapes that a motion is looked at in, in metres."""
PRECISION = 2.5e-4
"""To which the end of what is borne is found, in metres."""


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

    def borne(self, nodes: Vertices, motion: Point) -> float:
        """Return how much of a straight motion the object bears, as a share: 1 for all of it.

        That is up to where a tetrahedron would be squeezed below `LEAST_VOLUME_RATIO`, if not at
        the end of the motion.

        Args:
            nodes: Where the object is at rest now, in metres, (n, 3).
            motion: Of what the moving arm grips, from there, in metres.
        """
        if self._bears(self._moved(nodes, nodes, motion)):
            return 1.0
        length = max(float(np.linalg.norm(motion)), PRECISION)
        shape, good, stride = nodes, 0.0, min(STRIDE / length, 1.0)
        while stride * length > PRECISION:
            further = min(good + stride, 1.0)
            tried = self._moved(shape, nodes, further * motion)
            if self._bears(tried):
                shape, good = tried, further
            else:
                stride /= 2
        return good

    def _moved(self, shape: Vertices, start: Vertices, motion: Point) -> Vertices:
        """Return where the object rests, from a shape of it on, a motion away from the start."""
        held, gripped = start[self._start.held], start[self._start.gripped]
        return self.solver.settle(shape, np.concatenate([held, gripped + motion])).nodes

    def _bears(self, nodes: Vertices) -> bool:
        return bool(self._start.mesh.volume_ratios(nodes).min() >= LEAST_VOLUME_RATIO)

    def deviation(self, nodes: Vertices) -> float:
        """Return how far a settled shape is from the one that its grasp reaches straight from rest.

        Args:
            nodes: Of the settled shape, in metres, (n, 3).

        Returns:
            Distance of the worst node in metres.
        """
        straight = self.solver.settle(self._start.rest, nodes[self._start.pinned])
        return float(np.linalg.norm(nodes - straight.nodes, axis=1).max())
