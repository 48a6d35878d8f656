"""Elastic constants: from what an engineer states to what Bullet wants."""

import math
from typing import NamedTuple


class Lame(NamedTuple):
    """The Lame parameters of an isotropic linear-elastic solid, in pascals."""

    mu: float
    lam: float


def lame(young: float, poisson: float) -> Lame:
    """Return the Lame parameters of Young's modulus (Pa) and Poisson's ratio."""
    return Lame(
        mu=young / (2 * (1 + poisson)),
        lam=young * poisson / ((1 + poisson) * (1 - 2 * poisson)),
    )


def stable_neo_hookean(young: float, poisson: float) -> Lame:
    """Return the parameters of the stable Neo-Hookean energy with these small-strain constants.

    The energy of Smith, de Goes and Kim 2018 (Stable Neo-Hookean Flesh Simulation, section 3.4)
    is consistent with linear elasticity only after the reparameterisation mu' = 4/3 mu,
    lambda' = lambda + 5/6 mu. Bullet takes mu' and lambda' as they are: plain Lame parameters
    would give a body of 726 Pa for 1000 Pa.
    """
    mu, lam = lame(young, poisson)
    return Lame(mu=4 / 3 * mu, lam=lam + 5 / 6 * mu)


def wave_speed(young: float, poisson: float, density: float) -> float:
    """Return the speed of pressure waves in m/s: the fastest that anything spreads in a solid.

    Args:
        young: Young's modulus in pascals.
        poisson: Poisson's ratio.
        density: In kg/m^3.
    """
    mu, lam = lame(young, poisson)
    return math.sqrt((lam + 2 * mu) / density)
