"""Chamfer distances of many clouds to one, whose search tree is built once."""

import numpy as np
from scipy.spatial import cKDTree

from dnet.types import Cloud, Gaps


class ChamferTo:
    """The symmetric mean Chamfer distance to `reference`, as `dnet.geometry.chamfer` measures it.

    Args:
        reference: With one point or more.
    """

    def __init__(self, reference: Cloud) -> None:
        self._reference = reference
        self._tree = cKDTree(reference)

    def __call__(self, cloud: Cloud) -> float:
        """Return how far `cloud`, of one point or more, is from the reference, in metres."""
        return self.gaps(cloud).chamfer

    def gaps(self, cloud: Cloud) -> Gaps:
        """Return the distances, both ways, that this is the mean of."""
        # A tree for one search: one that is balanced takes longer to build than it saves.
        tree = cKDTree(cloud, balanced_tree=False, compact_nodes=False)
        there, _ = self._tree.query(cloud)
        back, _ = tree.query(self._reference)
        return Gaps(np.asarray(there, dtype=np.float64), np.asarray(back, dtype=np.float64))
