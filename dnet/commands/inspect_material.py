"""`dnet inspect material`: whether the simulated material is the one that was asked for."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Material:
    """Validate the material: E and nu in tension, bending, random shapes, the mesh.

    A bar in tension, cantilevers against Timoshenko's beam, random shapes against an independent
    solver, and meshes against a fine one. Every figure is printed with its limit; exits with 1 if
    a limit is broken. Takes some minutes.

    Example: dnet inspect material --out docs
    """

    shapes: int = 40
    """Random shapes to compare."""
    seed: int = 0
    """Of the random shapes."""
    out: Path | None = None
    """Write pictures/material.png there, and the tables into material.md, in place of those that
    an earlier call wrote into it."""

    def run(self) -> None:
        """Measure with a progress bar, print the tables and the verdict.

        Raises:
            TooFew: If no shapes are asked for.
            BrokenLimit: If a figure is outside its limits.
        """
        from rich.console import Console

        from dnet.commands.progress import progress
        from dnet.tools.material import validate
        from dnet.tools.material_checks import check_table, checks, mesh_table, refuse_broken
        from dnet.tools.material_document import write_tables
        from dnet.tools.material_plot import draw_material
        from dnet.tools.tables import print_table

        with progress(Console(stderr=True), "runs") as bars:
            tasks = {}

            def show(part: str, done: int, total: int) -> None:
                if part not in tasks:
                    tasks[part] = bars.add_task(part, total=total)
                bars.update(tasks[part], completed=done)

            validation = validate(self.shapes, seed=self.seed, on_progress=show)
        found = checks(validation)
        tables = [check_table(found), mesh_table(validation.resolutions)]
        for table in tables:
            print_table(table)
            print()
        rejected = validation.agreement.rejected
        if rejected:
            print("drawn again:", ", ".join(f"{count} {why}" for why, count in rejected.items()))
        took = ", ".join(f"{part} {seconds:.0f} s" for part, seconds in validation.seconds.items())
        print(f"{sum(check.holds for check in found)} of {len(found)} limits hold; {took}")
        if self.out is not None:
            picture, document = self.out / "pictures" / "material.png", self.out / "material.md"
            draw_material(validation, picture)
            write_tables(document, tables)
            print(f"wrote {document} and {picture}")
        refuse_broken(found)
