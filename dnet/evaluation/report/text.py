"""A report as Markdown and as CSV: the figures of the page, for people and for machines."""

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from dnet.evaluation.report.values import Claim, Report, Section, Sheet

PICTURES, TABLES = "pictures", "tables"
_CLAIMS = ("in the paper", "what", "paper", "ours", "verdict", "why, and how")


def markdown_of(report: Report) -> str:
    """Return a report as Markdown, its pictures beside it in `pictures`."""
    lines = [
        "# DeformerNet, reproduced",
        "",
        "Every figure of *DeformerNet: A Deep Learning Approach to 3D Deformable Object "
        "Manipulation* (Thach, Kuntz, Hermans 2021) beside what `dnet evaluate paper` came to. All "
        "of it follows from the logs in this directory: `dnet evaluate paper --from-logs` makes "
        "this page again.",
        "",
        "## The paper's figures, and ours",
        "",
        _row(_CLAIMS),
        _row(["---"] * len(_CLAIMS)),
        *(_row(_claim(claim)) for claim in report.claims),
    ]
    for section in report.sections:
        lines += _section(section)
    lines += ["", "## Provenance", *_sheet(report.provenance)]
    return "\n".join(lines) + "\n"


def claims_csv(report: Report) -> str:
    """Return every figure of the paper beside ours as CSV."""
    return _csv([_CLAIMS, *(_claim(claim) for claim in report.claims)])


def sheet_csv(sheet: Sheet) -> str:
    """Return a table as CSV, its numbers in full."""
    names = [column.name for column in sheet.columns]
    return _csv([names, *(["" if c is None else str(c) for c in row] for row in sheet.rows)])


def sheets_of(report: Report) -> list[Sheet]:
    """Return every table of a report."""
    return [*(sheet for section in report.sections for sheet in section.sheets), report.provenance]


def _section(section: Section) -> list[str]:
    lines = ["", f"## {section.title}"]
    for paragraph in section.about:
        lines += ["", paragraph]
    if not section.sheets:
        lines += ["", f"Not run: `dnet evaluate paper --only {section.name}`."]
    for sheet in section.sheets:
        lines += ["", f"### {sheet.title}", *_sheet(sheet)]
    for plot in section.plots:
        lines += ["", f"### {plot.title}", "", f"![{plot.title}]({PICTURES}/{plot.name}.png)"]
    for still in section.stills:
        lines += ["", f"![{still.name}]({PICTURES}/{still.name}.png)", "", still.caption]
    if section.runs:
        lines += ["", "Logs:", ""]
        lines += [f"- {one.what} ({one.outcome}): {_links(one.files)}" for one in section.runs]
    return lines


def _sheet(sheet: Sheet) -> list[str]:
    names = [column.name for column in sheet.columns]
    rules = ["---" if column.digits is None else "--:" for column in sheet.columns]
    lines = ["", _row(names), _row(rules), *map(_row, sheet.texts())]
    return [*lines, "", sheet.note] if sheet.note else lines


def _links(files: Sequence[Path]) -> str:
    return ", ".join(f"[{file.name}](<{file.as_posix()}>)" for file in files) or "no file"


def _claim(claim: Claim) -> tuple[str, ...]:
    ours = claim.ours or "–"
    return (claim.where, claim.what, claim.paper, ours, claim.verdict, claim.reason)


def _row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cell.replace('|', '/') for cell in cells)} |"


def _csv(rows: Sequence[Sequence[str]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()
