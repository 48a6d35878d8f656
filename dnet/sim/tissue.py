"""The object as a mesh: its shape at rest, and the end that the holding arm grips."""

from functools import lru_cache

import numpy as np
from jaxtyping import Int64

from dnet.sim.round_meshes import cylinder_mesh, hemi_ellipsoid_mesh
from dnet.sim.tetrahedra import TetrahedralMesh, Vertices, box_mesh
from dnet.types import Point, Tissue

HELD_SHARE = 0.1
"""Of an object without a flat end, the holding arm grips this share of the length."""
LEAST_FACE = 4
"""Nodes that make an end flat."""


@lru_cache(maxsize=16)
def tissue_mesh(tissue: Tissue) -> TetrahedralMesh:
    """Return the object at rest in its own frame: centred over the origin, lying on z = 0."""
    if tissue.shape == "cylinder":
        return cylinder_mesh(tissue.size, tissue.cells)
    if tissue.shape == "hemi_ellipsoid":
        return hemi_ellipsoid_mesh(tissue.size, tissue.cells)
    mesh = box_mesh(tissue.size, tissue.cells)
    return TetrahedralMesh(mesh.nodes + np.array([0.0, 0.0, tissue.size[2] / 2]), mesh.tetrahedra)


def held_nodes(nodes: Vertices) -> Int64[np.ndarray, "_"]:
    """Return which nodes of a mesh at rest, in its own frame, the holding arm grips.

    They are those of the end at least x: its face, which every mesh of a box has alike, or the
    outermost tenth of a body that has no face there.
    """
    along = (nodes[:, 0] - nodes[:, 0].min()) / np.ptp(nodes[:, 0])
    # A trifle more, so that rounding does not decide about nodes just at the limit.
    face = np.flatnonzero(along <= 1e-9)
    return face if len(face) >= LEAST_FACE else np.flatnonzero(along <= HELD_SHARE + 1e-9)


def hold_point(tissue: Tissue) -> Point:
    """Return where the holding arm's jaws close, in the object's own frame: on top, mid-width."""
    nodes = tissue_mesh(tissue).nodes
    held = nodes[held_nodes(nodes)]
    point: Point = held[np.argmax(held[:, 2] - np.abs(held[:, 1]))].copy()
    return point
