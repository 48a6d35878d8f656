"""What a report is made of: claims, tables, plots and pictures, however they will be shown."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

Cell = str | int | float | None
"""None, like NaN, is what is not known."""
Values = Float[np.ndarray, "_"]
Points = Float[np.ndarray, "_ 3"]


@dataclass(frozen=True, slots=True)
class Claim:
    """One figure of the paper, beside ours."""

    where: str
    """In the paper: a table, a figure or a section."""
    what: str
    paper: str
    """What it says, with its unit."""
    ours: str
    """What we measured, with the same unit; empty if nothing was."""
    met: bool | None
    """Whether ours is as good or shows the same; None if it was not measured."""
    reason: str
    """Why, or under which conditions."""

    @property
    def verdict(self) -> str:
        """What `met` is called."""
        return {True: "met", False: "not met", None: "not measured"}[self.met]


@dataclass(frozen=True, slots=True)
class Column:
    """One column of a table."""

    name: str
    """With its unit."""
    digits: int | None = None
    """After the point, of numbers; None for text and counts."""

    def text(self, cell: Cell) -> str:
        """Return a cell as people read it."""
        if cell is None or (isinstance(cell, float) and not math.isfinite(cell)):
            return "–"
        if isinstance(cell, str) or self.digits is None:
            return str(cell)
        return f"{cell:.{self.digits}f}"


@dataclass(frozen=True, slots=True)
class Sheet:
    """A table."""

    name: str
    """Of its file, without a suffix."""
    title: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""
    """What a reader must know to read it."""

    def texts(self) -> list[list[str]]:
        """Return the rows as people read them."""
        return [
            [column.text(cell) for column, cell in zip(self.columns, row, strict=True)]
            for row in self.rows
        ]


@dataclass(frozen=True, slots=True)
class Line:
    """A curve."""

    label: str
    x: Values
    y: Values


@dataclass(frozen=True, slots=True)
class Panel:
    """One of the fields of a plot, which share their axes."""

    title: str
    lines: tuple[Line, ...]


@dataclass(frozen=True, slots=True)
class LinePlot:
    """Curves in one or more fields beside each other."""

    name: str
    title: str
    x: str
    """What the axis shows, and its unit."""
    y: str
    panels: tuple[Panel, ...]
    steps: bool = False
    """Whether a curve stays at a value until the next: of shares, that jump."""


@dataclass(frozen=True, slots=True)
class Bar:
    """A value and the range about it."""

    label: str
    value: float
    low: float
    high: float
    group: str
    """What it is coloured by."""


@dataclass(frozen=True, slots=True)
class BarPlot:
    """Values below each other, each with its range."""

    name: str
    title: str
    x: str
    """What their lengths show, and its unit."""
    bars: tuple[Bar, ...]
    logarithmic: bool = False
    """Whether values are of several magnitudes, so that their ratios are what is to be seen."""


@dataclass(frozen=True, slots=True)
class Marks:
    """Points in space of one kind."""

    label: str
    points: Points
    """In metres, (n, 3)."""
    size: int = 2
    """On the screen."""


@dataclass(frozen=True, slots=True)
class SpacePlot:
    """Clouds and points to look at from all sides."""

    name: str
    title: str
    marks: tuple[Marks, ...]


Plot = LinePlot | BarPlot | SpacePlot


@dataclass(frozen=True, slots=True)
class Still:
    """A picture."""

    name: str
    """Of its file, without a suffix."""
    caption: str
    png: bytes


@dataclass(frozen=True, slots=True)
class RunLink:
    """One run, and where its files are."""

    what: str
    outcome: str
    files: tuple[Path, ...]
    """From the directory of the report."""


@dataclass(frozen=True, slots=True)
class Section:
    """What one experiment came to."""

    name: str
    title: str
    about: tuple[str, ...]
    """Paragraphs."""
    claims: tuple[Claim, ...] = ()
    sheets: tuple[Sheet, ...] = ()
    plots: tuple[Plot, ...] = ()
    stills: tuple[Still, ...] = ()
    runs: tuple[RunLink, ...] = ()


@dataclass(frozen=True, slots=True)
class Report:
    """All of it."""

    sections: tuple[Section, ...]
    provenance: Sheet
    """With which versions, seeds, data and weights each experiment was run."""

    @property
    def claims(self) -> Sequence[Claim]:
        """Every figure of the paper, section by section."""
        return [claim for section in self.sections for claim in section.claims]
