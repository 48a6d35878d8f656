"""All that is measured of the simulated material, in one go."""

import time
from collections.abc import Callable
from dataclasses import dataclass

from dnet.errors import TooFew
from dnet.tools.material_agreement import Agreement, compare
from dnet.tools.material_bending import KNOWN_RATIOS, Bending, bend
from dnet.tools.material_meshes import CANDIDATES, Resolution, compare_meshes
from dnet.tools.material_tension import Tension, pull
from dnet.types import Tissue


@dataclass(frozen=True, eq=False)
class Validation:
    """All that was measured of an object's material."""

    tissue: Tissue
    """The object as dnet simulates it by default."""
    tension: Tension
    bendings: list[Bending]
    agreement: Agreement
    resolutions: list[Resolution]
    seconds: dict[str, float]
    """How long each part took."""


def validate(
    shapes: int,
    *,
    seed: int = 0,
    on_progress: Callable[[str, int, int], object] = lambda *_: None,
) -> Validation:
    """Measure the material of the default object.

    Args:
        shapes: Random shapes to compare, with the independent solver and over meshes.
        seed: Of the random shapes.
        on_progress: Told the part, how much of it is done, and of how much.

    Raises:
        TooFew: If there are no shapes to compare.
        Unsettled: If a bar does not come to rest.
        NoValidShape: If too many random shapes in a row are rejected.
    """
    if shapes < 1:
        raise TooFew("number of shapes", shapes, 1)
    tissue = Tissue()
    constants = {"young": tissue.young, "poisson": tissue.poisson}
    seconds: dict[str, float] = {}

    def part(name: str, total: int) -> Callable[[], None]:
        """Begin a part, and return what counts it on."""
        start, done = time.perf_counter(), 0
        on_progress(name, 0, total)

        def advance() -> None:
            nonlocal done
            done += 1
            seconds[name] = time.perf_counter() - start
            on_progress(name, done, total)

        return advance

    advance = part("tension", 1)
    tension = pull(**constants)
    advance()
    return Validation(
        tissue=tissue,
        tension=tension,
        bendings=bend(**constants, advance=part("bending", len(KNOWN_RATIOS))),
        agreement=compare(tissue, shapes, seed=seed, advance=part("random shapes", shapes)),
        resolutions=compare_meshes(
            tissue, shapes, seed=seed, advance=part("meshes", shapes + len(CANDIDATES))
        ),
        seconds=seconds,
    )
