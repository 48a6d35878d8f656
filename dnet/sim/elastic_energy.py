"""The stable Neo-Hookean energy of a tetrahedral mesh and its gradient, compiled.

The energy is that of Smith, de Goes and Kim 2018 (Stable Neo-Hookean Flesh Simulation, equation
14), finite also where a tetrahedron is inverted:

    mu/2 (I - 3 - log(I + 1)) + lambda/2 (J - alpha)^2,  alpha = 1 + 3/4 mu/lambda,

with F the deformation gradient, I = tr(F^T F), J = det F; integrated over the rest volume.
"""

from typing import NamedTuple, no_type_check

import numpy as np
from jaxtyping import Float64, Int64

from dnet.compiled import compiled
from dnet.sim.material import Lame
from dnet.sim.tetrahedra import TetrahedralMesh

Components = Float64[np.ndarray, "3 _"]
"""A vector at every node, component by component: the order that the kernels read fastest."""
Triple = tuple[float, float, float]


class Elements(NamedTuple):
    """A mesh and its material as the kernels read them."""

    corners: Int64[np.ndarray, "4 _"]
    """The nodes of each tetrahedron."""
    inverse: Float64[np.ndarray, "9 _"]
    """The inverse of each tetrahedron's edge matrix at rest, row by row, in 1/m."""
    volumes: Float64[np.ndarray, "_"]
    """Rest volumes in cubic metres."""
    mu: float
    lam: float
    alpha: float


def elements(mesh: TetrahedralMesh, material: Lame) -> Elements:
    """Return a mesh, with the parameters of the energy in pascals, as the kernels read it."""
    inverse = np.linalg.inv(mesh.edges(mesh.nodes)).reshape(-1, 9)
    return Elements(
        corners=np.ascontiguousarray(mesh.tetrahedra.T),
        inverse=np.ascontiguousarray(inverse.T),
        volumes=mesh.volumes(mesh.nodes),
        mu=material.mu,
        lam=material.lam,
        alpha=1 + 3 / 4 * material.mu / material.lam,
    )


@compiled
@no_type_check
def energy_and_gradient(points: Components, body: Elements, gradient: Components) -> float:
    """Return the elastic energy in joules, and write its gradient in newtons.

    Args:
        points: Where the nodes are, in metres.
        body: Mesh and material.
        gradient: Overwritten.
    """
    for d in range(3):
        for i in range(gradient.shape[1]):
            gradient[d, i] = 0.0
    energy = 0.0
    for t in range(body.volumes.shape[0]):
        first, second, third, fourth = body.corners[:, t]
        b00, b01, b02, b10, b11, b12, b20, b21, b22 = body.inverse[:, t]
        volume = body.volumes[t]

        u = edge(points, first, second)
        v = edge(points, first, third)
        w = edge(points, first, fourth)
        # The columns of F, and of its cofactor matrix: the derivative of J by F.
        f0 = combine((b00, b10, b20), u, v, w)
        f1 = combine((b01, b11, b21), u, v, w)
        f2 = combine((b02, b12, b22), u, v, w)
        c0, c1, c2 = cross(f1, f2), cross(f2, f0), cross(f0, f1)
        ratio = dot(f0, c0)
        invariant = dot(f0, f0) + dot(f1, f1) + dot(f2, f2)
        excess = ratio - body.alpha

        shear = body.mu / 2 * (invariant - 3 - np.log(invariant + 1))
        energy += volume * (shear + body.lam / 2 * excess * excess)

        along = volume * body.mu * (1 - 1 / (invariant + 1))
        across = volume * body.lam * excess
        # The columns of the first Piola-Kirchhoff stress times the rest volume.
        p0 = blend(along, f0, across, c0)
        p1 = blend(along, f1, across, c1)
        p2 = blend(along, f2, across, c2)
        g1 = combine((b00, b01, b02), p0, p1, p2)
        g2 = combine((b10, b11, b12), p0, p1, p2)
        g3 = combine((b20, b21, b22), p0, p1, p2)
        for d in range(3):
            gradient[d, first] -= g1[d] + g2[d] + g3[d]
            gradient[d, second] += g1[d]
            gradient[d, third] += g2[d]
            gradient[d, fourth] += g3[d]
    return energy


@compiled
@no_type_check
def edge(points: Components, tail: int, head: int) -> Triple:
    """Return the vector from one node to another."""
    return (
        points[0, head] - points[0, tail],
        points[1, head] - points[1, tail],
        points[2, head] - points[2, tail],
    )


@compiled
@no_type_check
def blend(a: float, u: Triple, b: float, v: Triple) -> Triple:
    """Return a u + b v."""
    return (a * u[0] + b * v[0], a * u[1] + b * v[1], a * u[2] + b * v[2])


@compiled
@no_type_check
def combine(factors: Triple, u: Triple, v: Triple, w: Triple) -> Triple:
    """Return the sum of three vectors, each times its factor."""
    a, b, c = factors
    return (
        a * u[0] + b * v[0] + c * w[0],
        a * u[1] + b * v[1] + c * w[1],
        a * u[2] + b * v[2] + c * w[2],
    )


@compiled
@no_type_check
def cross(u: Triple, v: Triple) -> Triple:
    """Return the cross product."""
    return (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])


@compiled
@no_type_check
def dot(u: Triple, v: Triple) -> float:
    """Return the scalar product."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
