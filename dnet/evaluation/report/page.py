"""A report as one page that needs nothing else: tables, plots that move, pictures."""

import base64
from pathlib import Path
from typing import Any

from dnet.errors import MissingExtra
from dnet.evaluation.report.interactive import plotly_html, plotly_library
from dnet.evaluation.report.values import Report, Still

TEMPLATE = Path(__file__).with_name("page.html.j2")


def page_of(report: Report) -> str:
    """Return a report as HTML; the same report, the same text.

    Raises:
        MissingExtra: If jinja2 or plotly is not there.
    """
    template = _template(TEMPLATE.read_text(encoding="utf-8"))
    return str(
        template.render(
            report=report,
            counts={
                verdict: sum(claim.verdict == verdict for claim in report.claims)
                for verdict in ("met", "not met", "not measured")
            },
            plotly=plotly_library(),
            plot=plotly_html,
            source=_source,
        )
    )


def require_report() -> None:
    """Find out whether a report could be written, before hours of work for one.

    Raises:
        MissingExtra: If jinja2 or plotly is not there.
    """
    _template("")
    plotly_library()


def _source(still: Still) -> str:
    return f"data:image/png;base64,{base64.b64encode(still.png).decode()}"


def _template(text: str) -> Any:
    try:
        from jinja2 import Environment, StrictUndefined  # noqa: PLC0415
    except ImportError as error:
        raise MissingExtra("jinja2", "report", "a report") from error
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    return environment.from_string(text)
