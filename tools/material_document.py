"""The tables of the material's validation inside a Markdown document."""

from pathlib import Path

import polars as pl

BEGIN = "<!-- written by `dnet inspect material --out` -->"
END = "<!-- end of what `dnet inspect material --out` wrote -->"


def write_tables(path: Path, tables: list[pl.DataFrame]) -> None:
    """Put tables into a document, in place of those of an earlier call; make it if need be.

    Args:
        path: A Markdown file. What it says around the tables stays.
        tables: One after the other.
    """
    text = path.read_text() if path.exists() else ""
    before, _, rest = text.partition(BEGIN)
    _, _, after = rest.partition(END)
    written = "\n\n".join([BEGIN, *(_markdown(table) for table in tables), END])
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"{before}{written}{after or chr(10)}")


def _markdown(table: pl.DataFrame) -> str:
    """Return a table in Markdown, numbers to the right with two digits after the point."""
    ruler = ["---:" if kind.is_numeric() else "---" for kind in table.dtypes]
    rows = [
        [f"{value:.2f}" if isinstance(value, float) else str(value) for value in row]
        for row in table.iter_rows()
    ]
    return "\n".join(f"| {' | '.join(row)} |" for row in [table.columns, ruler, *rows])
