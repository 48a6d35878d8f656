"""What came of a long run: a table, a picture and a word on each figure.

    python -m tests.endurance.show /tmp/endurance
    python -m tests.endurance.show /tmp/endurance --docs docs/endurance

The second also writes DOCS/table.md and DOCS/picture.png, which docs/endurance.md shows.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro
from matplotlib.figure import Figure

from tests.endurance.figures import Figures, read_table
from tests.endurance.trend import NAMES, Trend, settled, trend

TABLE = "figures.csv"
LEAST = 12
"""Rounds that a line needs."""
MEGABYTES = ("rss", "anonymous", "heap", "disk")
TITLES = {
    "rss": "memory with shared pages (RSS), MB",
    "anonymous": "memory that is of no file, MB",
    "heap": "asked for by C code, MB",
    "objects": "Python's objects",
    "disk": "disk, MB",
    "files": "files and folders",
    "handles": "open handles",
    "threads": "threads",
    "processes": "processes",
}


@dataclass(frozen=True)
class Show:
    """Print the figures of a long run, and draw them."""

    run_of: tyro.conf.Positional[Path]
    """Directory of the run; it may be under way."""
    docs: Path | None = None
    """Directory to write the table and the picture to, for the documentation."""

    def run(self) -> None:
        """Print the table; draw FIGURES.png into the directory of the run, or into `docs`."""
        rows = read_table(self.run_of / TABLE)
        print(report(rows))
        if len(rows) < LEAST:
            return
        if self.docs is None:
            draw(rows, self.run_of / "figures.png")
            return
        self.docs.mkdir(parents=True, exist_ok=True)
        (self.docs / "table.md").write_text(report(rows), encoding="utf-8")
        draw(rows, self.docs / "picture.png")


def report(rows: Sequence[Figures]) -> str:
    """Return the table of the trends, as Markdown."""
    if len(rows) < LEAST:
        return f"{len(rows)} rounds: too few for a line, {LEAST} are needed\n"
    lines = [
        f"{len(rows)} rounds in {rows[-1].hours:.2f} hours; "
        f"lines are fitted after the first {len(rows) - len(settled(rows))}.\n",
        "| | median | lowest | highest | rise an hour | may rise | |",
        "|---|--:|--:|--:|--:|--:|---|",
        *(_line(trend(rows, name)) for name in NAMES),
    ]
    return "\n".join(lines) + "\n"


def _line(one: Trend) -> str:
    scale, digits = (1e-6, 2) if one.name in MEGABYTES else (1.0, 2)
    whole = 1 if one.name in MEGABYTES else 0
    held = (f"{scale * value:.{whole}f}" for value in (one.median, one.lowest, one.highest))
    rise = f"{scale * one.rise:+.{digits}f} ± {scale * one.error:.{digits}f}"
    bound = f"{scale * one.bound:.{digits}f}"
    return f"| {' | '.join((TITLES[one.name], *held, rise, bound, one.verdict))} |"


def draw(rows: Sequence[Figures], path: Path) -> None:
    """Draw each figure over time, and its line."""
    figure = Figure(figsize=(13, 8), layout="constrained")
    after = settled(rows)
    hours = [row.hours for row in rows]
    for axes, name in zip(figure.subplots(3, 3, sharex=True).flat, NAMES, strict=True):
        scale = 1e-6 if name in MEGABYTES else 1.0
        one = trend(rows, name)
        values = [scale * getattr(row, name) for row in rows]
        axes.plot(hours, values, ".", markersize=3, color="#35608d")
        middle = sum(row.hours for row in after) / len(after)
        mean = sum(getattr(row, name) for row in after) / len(after)
        ends = (after[0].hours, after[-1].hours)
        line = [scale * (mean + one.rise * (end - middle)) for end in ends]
        axes.plot(ends, line, color="#b9770e")
        axes.set_title(f"{TITLES[name]}: {one.verdict}", fontsize=9)
        axes.set_ylim(0, 1.25 * max(*values, 1e-3))
        axes.grid(alpha=0.3)
        if axes.get_subplotspec().is_last_row():
            axes.set_xlabel("hours")
    figure.savefig(path, dpi=90)


if __name__ == "__main__":
    tyro.cli(Show).run()
