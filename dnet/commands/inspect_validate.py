"""`dnet inspect validate`: whether episodes are whole, right and plausible."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import tyro

if TYPE_CHECKING:
    from dnet.tools.validate import Validation


@dataclass(frozen=True)
class Validate:
    """Read all of some episodes and say what is wrong with them.

    Every checksum, index and count is held against the file, every message is read and compared
    with the schema, with its fellows and with what is plausible: numbers that are none, times that
    run backwards, frames that lack a message, millimetres in place of metres. Of a directory its
    manifest is checked as well.

    An error makes a file unfit for use, a warning asks to look at it: an unfinished recording, a
    file without checksums. Exits with 1 if there is an error.

    Example: dnet inspect validate data/box
    """

    paths: tyro.conf.Positional[tuple[Path, ...]]
    """Episodes, and directories with some."""
    strict: tyro.conf.FlagCreatePairsOff[bool] = False
    """Exit with 1 for warnings too."""
    json: tyro.conf.FlagCreatePairsOff[bool] = False
    """Print one JSON object instead of a table."""

    def run(self) -> None:
        """Read the files, with a progress bar, and print what was found.

        Raises:
            TooFew: If there are no paths.
            MissingPath: If one of them does not exist.
            NoEpisodes: If a directory holds no episode.
            FaultyEpisodes: If something is wrong, after it was printed.
        """
        from dataclasses import asdict
        from json import dumps

        from dnet.tools.tables import print_table
        from dnet.tools.validate import finding_table, refuse_faulty

        validation = self._read()
        if self.json:
            counts = {"errors": validation.errors, "warnings": validation.warnings}
            print(dumps(counts | asdict(validation), indent=2, allow_nan=False))
        elif validation.findings:
            print_table(finding_table(validation))
            print(
                f"{validation.errors} errors, {validation.warnings} warnings "
                f"in {validation.episodes} episodes"
            )
        else:
            print(f"{validation.episodes} episodes, no faults")
        refuse_faulty(validation, strict=self.strict)

    def _read(self) -> "Validation":
        from rich.console import Console

        from dnet.commands.progress import progress
        from dnet.tools.validate import validate

        console = Console(stderr=True)
        bars = progress(console, "episodes")
        # Reading is no result: none of it stays on the screen, or goes into a log.
        bars.live.transient = True
        bars.disable = not console.is_terminal
        with bars:
            task = bars.add_task("validating", total=None)
            return validate(
                self.paths,
                on_file=lambda done, total: bars.update(task, completed=done, total=total),
            )
