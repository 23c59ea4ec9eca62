"""A report as one HTML page that asks nothing of the network and runs no script."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from pmg.pipeline.report.draw import PAGE, PHONE, draw_svg
from pmg.pipeline.report.theme import DARK, FONTS, LIGHT, variables

if TYPE_CHECKING:
    from pmg.pipeline.report.document import Report
    from pmg.pipeline.report.figure import Figure

_TEMPLATES = Path(__file__).with_name("templates")
_STATES = {"good": "Good", "attention": "Needs attention", "neutral": "Result"}


def html(report: Report) -> str:
    """The page of a report, figures inside; links to data files are relative.

    Parameters
    ----------
    report : Report
        What is told. All of its text is escaped.
    """
    environment = Environment(
        loader=FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
    )
    return environment.get_template("report.html.j2").render(
        report=report,
        drawings={figure.id: _drawing(figure) for figure in report.figures},
        numbers={table.id: count for count, table in enumerate(report.tables, 1)}
        | {figure.id: count for count, figure in enumerate(report.figures, 1)},
        cited={
            section.id: sorted({report.bibliography.index(source) + 1 for source in section.sources})
            for section in report.sections
        },
        states=_STATES,
        light=variables(LIGHT),
        dark=variables(DARK),
        fonts=FONTS,
        css=(_TEMPLATES / "report.css").read_text(encoding="utf-8"),
    )


def _drawing(figure: Figure) -> str:
    """The figure drawn for wide and for narrow screens; the style sheet shows one of them.

    A drawing escapes its own text; only its opening tag is added to.
    """
    label = escape(figure.caption)
    return "\n".join(
        draw_svg(figure, sheet).replace("<svg ", f'<svg class="drawing {kind}" role="img" aria-label="{label}" ', 1)
        for sheet, kind in ((PAGE, "wide"), (PHONE, "phone"))
    )
