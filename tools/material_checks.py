"""Whether the simulated material is the one that was asked for: every figure with its limit."""

from dataclasses import dataclass

import numpy as np
import polars as pl

from dnet.errors import BrokenLimit
from dnet.tools.material import Validation
from dnet.tools.material_agreement import Agreement
from dnet.tools.material_bending import KNOWN_RATIOS, Bending
from dnet.tools.material_meshes import Resolution, choose
from dnet.tools.material_tension import STRAIN, Tension, uniaxial
from dnet.types import Tissue

YOUNG_LIMIT = 0.02
"""Largest error of Young's modulus, as a share of it."""
POISSON_LIMIT = 0.05
"""Largest error of Poisson's ratio, as a share of it."""
CURVE_LIMIT = 0.01
"""Largest distance of the stress from that of the energy itself, as a share of it."""
BENDING_LIMIT = 0.02
"""Largest difference of a cantilever's ratio from the known one."""
MEAN_LIMIT_MM = 0.15
"""Mean node distance of PyBullet's shapes from the independent solver's, in millimetres."""
WORST_LIMIT_MM = 2.0
"""The same of the worst node of all shapes that are not bistable."""
BISTABLE_LIMIT = 0.05
"""Largest share of shapes that are bistable."""
UNSETTLED_LIMIT = 0.01
"""Largest share of pulls that never come to rest, left out of the node errors."""


@dataclass(frozen=True, slots=True)
class Check:
    """A figure and its limit."""

    name: str
    measured: str
    limit: str
    holds: bool


def checks(validation: Validation) -> list[Check]:
    """Return every figure with its limit."""
    return [
        *_tension_checks(validation.tissue, validation.tension),
        *(_bending_check(bending) for bending in validation.bendings),
        *_agreement_checks(validation.agreement),
        _mesh_check(validation.tissue, validation.resolutions),
    ]


def check_table(found: list[Check]) -> pl.DataFrame:
    """Return one row a figure: what it is, what was measured, the limit, the verdict."""
    rows = [(c.name, c.measured, c.limit, "holds" if c.holds else "BROKEN") for c in found]
    return pl.DataFrame(
        rows,
        schema=dict.fromkeys(("figure", "measured", "limit", "verdict"), pl.String),
        orient="row",
    )


def mesh_table(resolutions: list[Resolution]) -> pl.DataFrame:
    """Return one row a mesh."""
    return pl.DataFrame(
        {
            "cells": [_cells(resolution) for resolution in resolutions],
            "nodes": [resolution.nodes for resolution in resolutions],
            "pull mm": [resolution.pull_mm for resolution in resolutions],
            "95 % mm": [resolution.pull_95_mm for resolution in resolutions],
            "face mm": [resolution.face_mm for resolution in resolutions],
            "ms/step": [resolution.step_ms for resolution in resolutions],
            "s/shape": [resolution.shape_seconds for resolution in resolutions],
        }
    )


def refuse_broken(found: list[Check]) -> None:
    """Refuse figures outside their limits.

    Raises:
        BrokenLimit: If there are any.
    """
    broken = [f"{c.name} is {c.measured}, limit {c.limit}" for c in found if not c.holds]
    if broken:
        raise BrokenLimit(broken)


def _tension_checks(tissue: Tissue, tension: Tension) -> list[Check]:
    young, poisson = tissue.young, tissue.poisson
    curve, _ = uniaxial(tension.strain, young=young, poisson=poisson)
    strays = float(np.abs(tension.stress / curve - 1).max())
    at = f"at {STRAIN:.0%} strain"
    return [
        Check(
            f"Young's modulus {at}",
            f"{tension.young:.0f} Pa",
            f"{young:.0f} Pa ± {YOUNG_LIMIT:.0%}",
            abs(tension.young / young - 1) <= YOUNG_LIMIT,
        ),
        Check(
            f"Poisson's ratio {at}",
            f"{tension.poisson:.3f}",
            f"{poisson:.3f} ± {POISSON_LIMIT:.0%}",
            abs(tension.poisson / poisson - 1) <= POISSON_LIMIT,
        ),
        Check(
            "Young's modulus towards no strain",
            f"{tension.initial_young:.0f} Pa",
            f"{young:.0f} Pa ± {YOUNG_LIMIT:.0%}",
            abs(tension.initial_young / young - 1) <= YOUNG_LIMIT,
        ),
        Check(
            "stress from the energy's own curve",
            f"{strays:.2%}",
            f"{CURVE_LIMIT:.0%}",
            strays <= CURVE_LIMIT,
        ),
    ]


def _bending_check(bending: Bending) -> Check:
    known = KNOWN_RATIOS[bending.cells]
    cells = "1 cell" if bending.cells == 1 else f"{bending.cells} cells"
    return Check(
        f"cantilever, {cells} through the thickness",
        f"{bending.ratio:.3f} of Timoshenko",
        f"{known:.2f} ± {BENDING_LIMIT}",
        abs(bending.ratio - known) <= BENDING_LIMIT,
    )


def _agreement_checks(agreement: Agreement) -> list[Check]:
    count, bistable = len(agreement.bistable), int(agreement.bistable.sum())
    errors = agreement.from_rest[~agreement.bistable]
    unsettled = agreement.rejected["unsettled"]
    mean, worst = (float(errors.mean()), float(errors.max())) if len(errors) else (np.inf, np.inf)
    return [
        Check(
            f"mean node error of {count} random shapes",
            f"{mean:.3f} mm",
            f"{MEAN_LIMIT_MM} mm",
            mean <= MEAN_LIMIT_MM,
        ),
        Check(
            "worst node error of these shapes",
            f"{worst:.2f} mm",
            f"{WORST_LIMIT_MM} mm",
            worst <= WORST_LIMIT_MM,
        ),
        Check(
            "shapes with more than one equilibrium",
            f"{bistable} of {count}",
            f"{BISTABLE_LIMIT:.0%}",
            bistable <= BISTABLE_LIMIT * count,
        ),
        Check(
            "pulls that never came to rest",
            f"{unsettled} of {count + unsettled}",
            f"{UNSETTLED_LIMIT:.0%}",
            unsettled <= UNSETTLED_LIMIT * (count + unsettled),
        ),
    ]


def _mesh_check(tissue: Tissue, resolutions: list[Resolution]) -> Check:
    chosen = choose(resolutions)
    return Check(
        "default mesh",
        " x ".join(str(count) for count in tissue.cells),
        f"{_cells(chosen)}, chosen below",
        tissue.cells == chosen.cells,
    )


def _cells(resolution: Resolution) -> str:
    return " x ".join(str(count) for count in resolution.cells)
