"""The bending test: how much of the deflection of a cantilever a mesh of tetrahedra allows.

Linear tetrahedra cannot bend, only shear: a mesh with few cells through the thickness is too stiff
(it locks). The ratio of its deflection to that of Timoshenko's beam says by how much.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from dnet.sim.self_weight import hang
from dnet.sim.tetrahedra import box_mesh

KNOWN_RATIOS = {1: 0.35, 2: 0.66, 3: 0.80, 4: 0.87, 6: 0.93}
"""Deflection over Timoshenko's by the number of cells through the thickness, as known of cubes
split into five tetrahedra whose neighbours are mirrored."""
THICKNESS = 0.02
"""Width and thickness of the cantilever in metres."""
SLENDERNESS = 5
"""Its length over its thickness."""
DENSITY = 1000.0
DEFLECTION = 0.02
"""Deflection of Timoshenko's beam over its length: small, so that the theory holds."""

Values = Float64[np.ndarray, "_"]


@dataclass(frozen=True, slots=True)
class Bending:
    """A cantilever of cubic cells under its own weight."""

    cells: int
    """Cells through the thickness."""
    nodes: int
    ratio: float
    """Deflection of its end over that of Timoshenko's beam."""


def bend(
    *, young: float, poisson: float, advance: Callable[[], object] = lambda: None
) -> list[Bending]:
    """Let cantilevers of every mesh with a known ratio sag in PyBullet.

    Args:
        young: Young's modulus in pascals.
        poisson: Poisson's ratio.
        advance: Called after each.

    Raises:
        Unsettled: If one does not come to rest.
    """
    bendings = []
    for cells in KNOWN_RATIOS:
        bendings.append(cantilever(cells, young=young, poisson=poisson))
        advance()
    return bendings


def cantilever(
    cells: int, *, young: float, poisson: float, slenderness: int = SLENDERNESS
) -> Bending:
    """Let one cantilever sag in PyBullet.

    Args:
        cells: How many it has through its thickness.
        young: Young's modulus in pascals.
        poisson: Poisson's ratio.
        slenderness: Its length over its thickness.

    Raises:
        Unsettled: If it does not come to rest.
    """
    length = slenderness * THICKNESS
    mesh = box_mesh((length, THICKNESS, THICKNESS), (slenderness * cells, cells, cells))
    x = mesh.nodes[:, 0]
    weight = np.full(len(x), DENSITY * length * THICKNESS**2 / len(x))
    deflection = timoshenko(
        weight, x - x.min(), young=young, poisson=poisson, width=THICKNESS, thickness=THICKNESS
    )
    gravity = DEFLECTION * length / deflection
    hanging = hang(
        mesh,
        np.flatnonzero(x == x.min()),
        np.array([0.0, 0.0, -gravity]),
        young=young,
        poisson=poisson,
        density=DENSITY,
    )
    sunk = (mesh.nodes - hanging.nodes)[x == x.max(), 2].mean()
    return Bending(cells=cells, nodes=len(x), ratio=float(sunk) / (DEFLECTION * length))


def timoshenko(
    forces: Values,
    places: Values,
    *,
    young: float,
    poisson: float,
    width: float,
    thickness: float,
) -> float:
    """Return the deflection at the end of a Timoshenko cantilever under transverse forces.

    A force F at distance a from the clamp lowers the end at L by F a^2 (3 L - a) / (6 E I) by
    bending and by F a / (k G A) by shear, with the shear coefficient k = 10 (1 + nu) / (12 + 11 nu)
    of a rectangular section (Cowper 1966, The Shear Coefficient in Timoshenko's Beam Theory).

    Args:
        forces: Downward, in newtons.
        places: Where they act: distances from the clamp in metres, the farthest at the end.
        young: Young's modulus in pascals.
        poisson: Poisson's ratio.
        width: Of the section, in metres.
        thickness: Of the section along the forces, in metres.
    """
    length = float(places.max())
    area, inertia = width * thickness, width * thickness**3 / 12
    shear_modulus = young / (2 * (1 + poisson))
    coefficient = 10 * (1 + poisson) / (12 + 11 * poisson)
    bending = places**2 * (3 * length - places) / (6 * young * inertia)
    shear = places / (coefficient * shear_modulus * area)
    return float(forces @ (bending + shear))
