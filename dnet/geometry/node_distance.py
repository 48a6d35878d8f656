"""How far two shapes of one mesh are from each other, node by node: ground truth, for scores."""

import numpy as np

from dnet.types import Nodes


def node_distance(nodes: Nodes, goal: Nodes | None) -> float:
    """Return the mean distance of nodes from where they are in the goal, in metres.

    NaN if that is not known, or of another mesh.
    """
    if goal is None or goal.shape != nodes.shape:
        return float("nan")
    return float(np.linalg.norm(nodes - goal, axis=1).mean())
