"""`dnet doctor`: what works on this machine, and the commands that mend what does not."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import tyro

if TYPE_CHECKING:
    from dnet.diagnosis.attempts import Outcome


@dataclass(frozen=True)
class Doctor:
    """Try what works on this machine, and say what mends the rest.

    Everything is done once in a small way: a soft body is moved, a path planned, an episode
    written and read, a network asked and trained, a recording made, an object put into a store.
    The processes in which it is done may crash or hang: that is told like any other fault. Beside
    that stand the versions of all packages, with the extra that brings those that are missing, the
    system's libraries, and what there is of processors, memory, disk and open files.

    Exits with 1 if recording, training, servoing or playing is broken; what only an extra or a
    screen is needed for may be missing.

    Example: dnet doctor

    Example: dnet doctor --json > machine.json
    """

    thorough: tyro.conf.FlagCreatePairsOff[bool] = False
    """Also do what takes a minute: compile the kernels of the networks, train with an optimizer,
    draw a screenshot, start a Ray cluster."""
    json: tyro.conf.FlagCreatePairsOff[bool] = False
    """Print one JSON object instead of tables."""

    def run(self) -> None:
        """Try everything, with a progress bar, and print what came out.

        Raises:
            Unfit: If something that dnet needs does not work, after all was printed.
        """
        import json
        from pathlib import Path

        from dnet.commands.doctor_tables import document, show
        from dnet.diagnosis.libraries import missing_libraries
        from dnet.diagnosis.machine import facts
        from dnet.errors import Unfit

        outcomes = self._try()
        found, missing = facts(Path.cwd()), missing_libraries()
        if self.json:
            print(json.dumps(document(outcomes, found, missing), indent=2, ensure_ascii=False))
        else:
            show(outcomes, found, missing)
        broken = [
            outcome.ability.name
            for outcome in outcomes
            if outcome.ability.needed and outcome.status != "works"
        ]
        if broken:
            raise Unfit(broken)

    def _try(self) -> "list[Outcome]":
        from rich.console import Console

        from dnet.commands.progress import progress
        from dnet.diagnosis.abilities import ABILITIES
        from dnet.diagnosis.attempts import try_all
        from dnet.diagnosis.machine import cores

        console = Console(stderr=True)
        bars = progress(console, "attempts")
        # What is tried is no result: none of it stays on the screen, or goes into a log.
        bars.live.transient = True
        bars.disable = not console.is_terminal
        with bars:
            task = bars.add_task("trying", total=len(ABILITIES))
            return try_all(
                thorough=self.thorough, cores=cores(), on_outcome=lambda: bars.advance(task)
            )
