"""The extended FPFH of a cloud: one vector of 135 numbers that says how its surface is turned.

Fast Point Feature Histograms (Rusu, Blodow and Beetz 2009) hold, for every point, histograms of
three angles between its normal and those of its neighbours. The Viewpoint Feature Histogram (Rusu,
Bradski, Thibaux and Hsu 2010) extends them to a whole object: one point, the centroid, and all
others as its neighbours, with 45 bins for each angle. Of its 308 bins, those 3 x 45 = 135 are its
extended FPFH (the others count distances from the centroid, 45, and directions from the camera,
128); Hu, Han, Sun, Pan and Manocha 2019 steer by it.

Open3D has FPFH of single points alone, 33 numbers each; this is the part of VFH that there is no
well-kept Python library for. Taken from the 2010 paper: the frame, the angles, the bins, and that
angles but for the last are counted by their cosine, as in PCL. Decided here: the normal of the
centroid is the mean of all normals, made a unit vector; the frame is always that of the centroid,
while PCL swaps the two points of a pair where the other normal is nearer to the line between them;
and each histogram adds up to one, not to 100.

Angles between parts of one surface are blind to where it lies and which way it faces: a cloud that
is turned, shifted or scaled as a whole, with the camera, has the same histograms.
"""

import numpy as np
from jaxtyping import Float32, Float64

from dnet.geometry.normals import normals
from dnet.types import Cloud, Point

BINS = 45
"""Of each angle (Rusu et al. 2010)."""
FEATURES = 3 * BINS


def extended_fpfh(cloud: Cloud, eye: Point) -> Float32[np.ndarray, " 135"]:
    """Return the histograms of the three angles, one after another, each with the sum one.

    With the centroid's unit normal u, the direction d to a point of normal n, v = d x u made a unit
    vector, and w = u x v, they are of v.n, of u.d, and of atan2(w.n, u.n).

    Args:
        cloud: A visible surface, (n, 3); points straight above or below the centroid, which leave
            v open, are not counted.
        eye: Where the camera stands, towards which normals point.
    """
    points, own = cloud.astype(np.float64), normals(cloud, eye)
    u = _unit(own.mean(axis=0, keepdims=True))
    d = _unit(points - points.mean(axis=0))
    v = np.cross(d, u)
    counted = np.linalg.norm(v, axis=1) > 1e-9
    d, own, v = d[counted], own[counted], _unit(v[counted])
    w = np.cross(u, v)
    twist = np.arctan2((w * own).sum(axis=1), (u * own).sum(axis=1))
    angles = (v * own).sum(axis=1), (u * d).sum(axis=1), twist / np.pi
    return np.concatenate([_histogram(angle) for angle in angles]).astype(np.float32)


def _histogram(values: Float64[np.ndarray, " n"]) -> Float64[np.ndarray, " 45"]:
    """Return the shares of values in equal bins from -1 to 1."""
    bins = np.clip(np.floor(BINS * (values + 1) / 2).astype(np.int64), 0, BINS - 1)
    return np.bincount(bins, minlength=BINS) / max(len(bins), 1)


def _unit(vectors: Float64[np.ndarray, "n 3"]) -> Float64[np.ndarray, "n 3"]:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-12)
