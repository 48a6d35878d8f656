"""Hours of work in one process, to see whether anything grows that should stay.

    python -m tests.endurance --hours 2 --out /tmp/endurance

Each round records, checks, trains and servoes (`tests.endurance.rounds`), is measured, and what
it wrote is deleted. OUT/figures.csv has a row a round. Ctrl-C ends the run and shows what there
is. Exits with 1 if a figure grows.
"""

import os
import shutil
import signal
from contextlib import closing, redirect_stderr, redirect_stdout, suppress
from dataclasses import dataclass
from pathlib import Path
from time import monotonic

import tyro

from tests.endurance.figures import Table, measure
from tests.endurance.show import LEAST, TABLE, Show
from tests.endurance.trend import NAMES, trend

MARGIN = 2.0
"""Megabytes of the commands' words that are kept; what is older is thrown away."""


@dataclass(frozen=True)
class Endurance:
    """Work for hours, and measure after each round."""

    out: Path
    """Directory for everything; must not exist."""
    hours: float = 2.0
    """No round begins after these."""

    def run(self) -> None:
        """Work, measure, and print what came out."""
        self.out.mkdir(parents=True)
        held = self._stay_inside()
        # Started in the background, it would not hear Ctrl-C.
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, signal.default_int_handler)
        with closing(Table(self.out / TABLE)) as table, suppress(KeyboardInterrupt):
            self._work(table, held)
        Show(self.out).run()
        rows = table.rows
        if len(rows) >= LEAST and any(trend(rows, name).verdict == "grows" for name in NAMES):
            raise SystemExit(1)

    def _stay_inside(self) -> Path:
        """Send scratch files and caches to the directory too, so that they are measured."""
        held = (self.out / "held").resolve()
        for name, folder in (("TMPDIR", "scratch"), ("XDG_CACHE_HOME", "cache")):
            (held / folder).mkdir(parents=True)
            os.environ[name] = str(held / folder)
        return held

    def _work(self, table: Table, held: Path) -> None:
        from tests.endurance.rounds import work  # noqa: PLC0415  # after the caches have a place

        begin = monotonic()
        number = 0
        while (monotonic() - begin) / 3600 < self.hours:
            # A name of its own: servo knows networks by the names of their files.
            folder = held / f"round-{number}"
            log = self.out / "log.txt"
            mode = "a" if log.exists() and log.stat().st_size < 1e6 * MARGIN else "w"
            with (
                log.open(mode, encoding="utf-8") as said,
                redirect_stdout(said),
                redirect_stderr(said),
            ):
                work(folder, number=number)
            shutil.rmtree(folder)
            hours = (monotonic() - begin) / 3600
            table.add(measure(held, number=number, hours=hours))
            number += 1


if __name__ == "__main__":
    tyro.cli(Endurance).run()
