"""Data frames as tables on a terminal, whole and unwrapped in a pipe, or for machines."""

import json
import sys
from typing import Literal

import polars as pl
from rich.console import Console
from rich.table import Table
from rich.text import Text

DECIMALS = dict.fromkeys(("x", "y", "z", "motion_x", "motion_y", "motion_z"), 4)
"""Digits after the point by column; two for the others."""
WRAPPED = ("note",)
"""Columns of prose: these give way on a narrow terminal."""
UNWRAPPED_WIDTH = 2000


Form = Literal["table", "csv", "json"]
"""For people; for spreadsheets; for programs: a list of objects."""


def print_frame(frame: pl.DataFrame, form: Form) -> None:
    """Print `frame` in one of the forms."""
    if form == "csv":
        sys.stdout.write(frame.write_csv())
    elif form == "json":
        print(json.dumps(frame.to_dicts(), indent=2, allow_nan=False))  # noqa: T201
    else:
        print_table(frame)


def print_table(frame: pl.DataFrame) -> None:
    """Print `frame` whole, numbers to the right."""
    console = Console()
    if not console.is_terminal:
        # What is piped into another program must not be cut to a guessed width.
        console = Console(width=UNWRAPPED_WIDTH)
    table = Table(box=None, header_style="bold", pad_edge=False)
    for name, kind in frame.schema.items():
        table.add_column(
            name,
            justify="right" if kind.is_numeric() else "left",
            no_wrap=name not in WRAPPED,
            overflow="fold",
        )
    for row in frame.iter_rows(named=True):
        table.add_row(*(Text(_cell(name, value)) for name, value in row.items()))
    console.print(table)


def _cell(name: str, value: object) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.{DECIMALS.get(name, 2)}f}"
    return str(value)
