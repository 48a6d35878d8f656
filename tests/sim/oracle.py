"""An independent solver of the same elastic energy: plain numpy and scipy, no Bullet.

The stable Neo-Hookean energy of Smith, de Goes and Kim 2018, equation 14, written down as it
stands and minimised over the free nodes, the pinned ones moved to their targets little by little.
"""

import numpy as np
from scipy.optimize import minimize

from dnet.sim.tetrahedra import TetrahedralMesh, Vertices

INCREMENT = 0.004
"""Largest move of a pinned node between two minimisations, in metres."""


class Oracle:
    def __init__(self, mesh: TetrahedralMesh, *, mu: float, lam: float) -> None:
        self._corners = mesh.tetrahedra
        self._inverse = np.linalg.inv(mesh.edges(mesh.nodes))
        self._volumes = mesh.volumes(mesh.nodes)
        self._mu, self._lam = mu, lam
        self._alpha = 1 + 3 / 4 * mu / lam
        self._mesh = mesh

    def energy_and_gradient(self, nodes: Vertices) -> tuple[float, Vertices]:
        deformation = self._mesh.edges(nodes) @ self._inverse
        invariant = np.einsum("tij,tij->t", deformation, deformation)
        ratio = np.linalg.det(deformation)
        density = (
            self._mu / 2 * (invariant - 3 - np.log(invariant + 1))
            + self._lam / 2 * (ratio - self._alpha) ** 2
        )
        a, b, c = (deformation[:, :, k] for k in range(3))
        cofactor = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=-1)
        stress = (
            self._mu * (1 - 1 / (invariant + 1))[:, None, None] * deformation
            + self._lam * (ratio - self._alpha)[:, None, None] * cofactor
        )
        forces = self._volumes[:, None, None] * stress @ self._inverse.transpose(0, 2, 1)
        gradient = np.zeros_like(nodes)
        for corner in (1, 2, 3):
            np.add.at(gradient, self._corners[:, corner], forces[:, :, corner - 1])
        np.add.at(gradient, self._corners[:, 0], -forces.sum(axis=2))
        return float(density @ self._volumes), gradient

    def settle(self, nodes: Vertices, pinned: np.ndarray, targets: Vertices) -> Vertices:
        """Return the shape at rest after the pinned nodes have moved to their targets."""
        nodes = nodes.copy()
        free = np.setdiff1d(np.arange(len(nodes)), pinned)
        start = nodes[pinned].copy()
        count = max(1, int(np.ceil(np.abs(targets - start).max() / INCREMENT)))

        def objective(flat: np.ndarray) -> tuple[float, np.ndarray]:
            nodes[free] = flat.reshape(-1, 3)
            energy, gradient = self.energy_and_gradient(nodes)
            # In units of a typical energy and of millimetres, so that tolerances mean something.
            return energy * 1e6, gradient[free].ravel() * 1e6

        for step in range(1, count + 1):
            nodes[pinned] = start + (targets - start) * step / count
            last = step == count
            found = minimize(
                objective,
                nodes[free].ravel(),
                jac=True,
                method="L-BFGS-B",
                options={
                    "maxiter": 3000 if last else 60,
                    "ftol": 1e-13,
                    "gtol": 1e-3,
                    "maxcor": 30,
                },
            )
            nodes[free] = found.x.reshape(-1, 3)
        return nodes
