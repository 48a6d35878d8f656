"""A report written into its directory: the page, Markdown, CSV, and the pictures of both."""

from collections.abc import Mapping
from pathlib import Path

from dnet.evaluation.report.page import page_of
from dnet.evaluation.report.still_plots import draw_plot
from dnet.evaluation.report.text import (
    PICTURES,
    TABLES,
    claims_csv,
    markdown_of,
    sheet_csv,
    sheets_of,
)
from dnet.evaluation.report.values import Report
from dnet.files.whole_file import write_whole

PAGE, MARKDOWN, CLAIMS = "report.html", "report.md", "report.csv"


def write_report(report: Report, out: Path) -> None:
    """Write a report, each file whole or not at all; the same report, the same bytes.

    Raises:
        MissingExtra: If jinja2 or plotly is not there.
    """
    for name, content in _files(report).items():
        write_whole(out / name, content)


def _files(report: Report) -> Mapping[str, bytes]:
    """Return the content of each file, the page last: who sees it finds the rest there."""
    sections = report.sections
    pictures = {
        **{plot.name: draw_plot(plot) for section in sections for plot in section.plots},
        **{still.name: still.png for section in sections for still in section.stills},
    }
    return {
        **{f"{PICTURES}/{name}.png": png for name, png in pictures.items()},
        **{f"{TABLES}/{sheet.name}.csv": sheet_csv(sheet).encode() for sheet in sheets_of(report)},
        CLAIMS: claims_csv(report).encode(),
        MARKDOWN: markdown_of(report).encode(),
        PAGE: page_of(report).encode(),
    }
