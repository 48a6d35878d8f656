"""Points of an object by what they are made of: where they are when its mesh deforms."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, Float64, Int64
from scipy.spatial import cKDTree

from dnet.types import Cloud, Nodes

Triangles = Int64[np.ndarray, "_ 3"]

# Of triangles whose centres are nearest to a point, one is the nearest: meshes here are regular.
_CANDIDATES = 16


@dataclass(frozen=True)
class MaterialPoints:
    """Points on the surface of a mesh, each by its triangle and barycentric coordinates."""

    corners: Int64[np.ndarray, "n 3"]
    """Nodes of the triangle that each point is on."""
    weights: Float64[np.ndarray, "n 3"]
    """Of the three nodes."""

    @classmethod
    def of(cls, cloud: Cloud, nodes: Nodes, triangles: Triangles) -> "MaterialPoints":
        """Return the material points nearest to those of a cloud.

        Args:
            cloud: Seen when the nodes were where they are, in metres.
            nodes: Of the mesh at that time.
            triangles: Its surface, as rows of `nodes`.
        """
        corners = nodes.astype(np.float64)[triangles]
        count = min(_CANDIDATES, len(triangles))
        _, found = cKDTree(corners.mean(axis=1)).query(cloud, k=count)
        candidates = np.asarray(found, np.int64).reshape(len(cloud), count)
        weights = _nearest_weights(cloud.astype(np.float64)[:, None], corners[candidates])
        places = np.einsum("nkc,nkcx->nkx", weights, corners[candidates])
        best = np.linalg.norm(places - cloud[:, None], axis=2).argmin(axis=1)
        rows = np.arange(len(cloud))
        return cls(triangles[candidates[rows, best]], weights[rows, best])

    def at(self, nodes: Nodes) -> Float32[np.ndarray, "n 3"]:
        """Return where the points are when the nodes are there."""
        places = np.einsum("nc,ncx->nx", self.weights, nodes.astype(np.float64)[self.corners])
        return places.astype(np.float32)


def _nearest_weights(
    points: Float64[np.ndarray, "n 1 3"], corners: Float64[np.ndarray, "n k 3 3"]
) -> Float64[np.ndarray, "n k 3"]:
    """Return barycentric coordinates, in each triangle, of what is nearest to each point.

    A point that is over the triangle falls on its plane; any other is nearest to one of the three
    edges (Ericson, Real-Time Collision Detection, 2004).
    """
    inside = _plane_weights(points, corners)
    tried = [np.where((inside >= 0).all(axis=-1, keepdims=True), inside, np.nan)]
    for first, second in ((0, 1), (1, 2), (2, 0)):
        edge = corners[..., second, :] - corners[..., first, :]
        along = ((points - corners[..., first, :]) * edge).sum(-1) / (edge**2).sum(-1)
        share = np.clip(along, 0.0, 1.0)
        weights = np.zeros_like(inside)
        weights[..., first], weights[..., second] = 1 - share, share
        tried.append(weights)
    choices = np.stack(tried)
    places = np.einsum("enkc,nkcx->enkx", choices, corners)
    distances = np.linalg.norm(places - points, axis=-1)
    best = np.nan_to_num(distances, nan=np.inf).argmin(axis=0)
    return np.take_along_axis(choices, best[None, ..., None], axis=0)[0]


def _plane_weights(
    points: Float64[np.ndarray, "n 1 3"], corners: Float64[np.ndarray, "n k 3 3"]
) -> Float64[np.ndarray, "n k 3"]:
    """Return barycentric coordinates of points dropped onto the planes of triangles."""
    one = corners[..., 1, :] - corners[..., 0, :]
    two = corners[..., 2, :] - corners[..., 0, :]
    at = points - corners[..., 0, :]
    a, b, c = (one * one).sum(-1), (one * two).sum(-1), (two * two).sum(-1)
    d, e = (at * one).sum(-1), (at * two).sum(-1)
    area = a * c - b * b
    v, w = (c * d - b * e) / area, (a * e - b * d) / area
    return np.stack([1 - v - w, v, w], axis=-1)
