"""The tension test: what Young's modulus and Poisson's ratio a hanging bar turns out to have.

In a bar that hangs by one end, the stress in a cross-section is the weight below it over its area:
one bar shows the whole curve of stress against strain. Cross-sections within a bar's width of
either end are left out, as the grip hinders lateral contraction there (Saint-Venant's principle).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.optimize import brentq

from dnet.sim.material import stable_neo_hookean
from dnet.sim.self_weight import hang
from dnet.sim.tetrahedra import TetrahedralMesh, Vertices, box_mesh

STRAIN = 0.03
"""The strain at which the constants are stated, as a share of the length."""
SIZE = (0.16, 0.04, 0.04)
"""Length, width and thickness of the bar in metres."""
CELLS = (16, 4, 4)
DENSITY = 1000.0

Values = Float64[np.ndarray, "_"]


@dataclass(frozen=True, eq=False)
class Tension:
    """The slices of a bar between its cross-sections, and the constants that they show."""

    strain: Values
    """Elongation of each slice as a share of its rest length."""
    stress: Values
    """Nominal stress of each slice in pascals: force over rest area."""
    contraction: Values
    """Lateral contraction of each slice as a share of its width."""
    young: float
    """Stress over strain (secant modulus) at `STRAIN`, in pascals."""
    poisson: float
    """Contraction over strain at `STRAIN`."""
    initial_young: float
    """Stress over strain extrapolated to no strain, in pascals."""
    initial_poisson: float
    """Contraction over strain extrapolated to no strain."""


def pull(*, young: float, poisson: float) -> Tension:
    """Hang a bar of a material in PyBullet, and measure it at `STRAIN` in its middle.

    Args:
        young: Young's modulus that is asked of the simulation, in pascals.
        poisson: Poisson's ratio likewise.

    Raises:
        Unsettled: If the bar does not come to rest.
    """
    mesh = box_mesh(SIZE, CELLS)
    x = mesh.nodes[:, 0]
    gravity = 2 * STRAIN * young / (DENSITY * SIZE[0])
    hanging = hang(
        mesh,
        np.flatnonzero(x == x.min()),
        np.array([gravity, 0.0, 0.0]),
        young=young,
        poisson=poisson,
        density=DENSITY,
    )
    sections = [np.flatnonzero(x == place) for place in np.unique(x)]
    places = np.array([_mean_x(mesh, hanging.nodes, section) for section in sections])
    narrowing = np.array([_narrowing(mesh, hanging.nodes, section) for section in sections])
    below = len(x) - np.cumsum([len(section) for section in sections])[:-1]

    strain = np.diff(places) / np.diff(np.unique(x)) - 1
    stress = hanging.node_weight * below / (SIZE[1] * SIZE[2])
    contraction = (narrowing[1:] + narrowing[:-1]) / 2
    margin = round(SIZE[1] / SIZE[0] * CELLS[0])
    gauge = slice(margin, len(strain) - margin)
    strain, stress, contraction = strain[gauge], stress[gauge], contraction[gauge]
    # Both ratios are straight lines in the strain, as far as strains are small.
    modulus = np.polynomial.Polynomial.fit(strain, stress / strain, 1)
    ratio = np.polynomial.Polynomial.fit(strain, contraction / strain, 1)
    return Tension(
        strain=strain,
        stress=stress,
        contraction=contraction,
        young=float(modulus(STRAIN)),
        poisson=float(ratio(STRAIN)),
        initial_young=float(modulus(0.0)),
        initial_poisson=float(ratio(0.0)),
    )


def uniaxial(strain: Values, *, young: float, poisson: float) -> tuple[Values, Values]:
    """Return the nominal stress in pascals and the contraction of the energy itself, in tension.

    The stable Neo-Hookean energy (Smith, de Goes and Kim 2018, equation 14) gives way as it is
    stretched: at 3 % strain its secant modulus is 1.8 % below a Young's modulus of 1000 Pa, for
    Poisson's ratio 0.3.
    """
    mu, lam = stable_neo_hookean(young, poisson)
    alpha = 1 + 3 / 4 * mu / lam

    def stresses(axial: float, lateral: float) -> tuple[float, float]:
        shear = mu * (1 - 1 / (axial**2 + 2 * lateral**2 + 1))
        excess = lam * (axial * lateral**2 - alpha)
        return shear * axial + excess * lateral**2, shear * lateral + excess * axial * lateral

    def free_lateral(axial: float) -> float:
        return float(brentq(lambda lateral: stresses(axial, lateral)[1], 0.5, 1.5))

    stretches = [(1 + value, free_lateral(1 + value)) for value in strain.tolist()]
    stress = np.array([stresses(*stretch)[0] for stretch in stretches])
    return stress, np.array([1 - lateral for _, lateral in stretches])


def _mean_x(mesh: TetrahedralMesh, nodes: Vertices, section: np.ndarray) -> float:
    """Return where a cross-section is in the mean over its area."""
    rest = mesh.nodes[section]
    # A node on an edge of the section stands for half the area of one within.
    on_edge = np.abs(rest[:, 1:]) == np.abs(rest[:, 1:]).max(axis=0)
    return float(np.average(nodes[section, 0], weights=0.5 ** on_edge.sum(axis=1)))


def _narrowing(mesh: TetrahedralMesh, nodes: Vertices, section: np.ndarray) -> float:
    """Return how much narrower a cross-section has become, as a share of its width."""
    slopes = [
        np.polynomial.Polynomial.fit(mesh.nodes[section, axis], nodes[section, axis], 1)
        for axis in (1, 2)
    ]
    return 1 - float(np.mean([slope.deriv()(0.0) for slope in slopes]))
