"""A report as one HTML page that asks nothing of the network."""

from __future__ import annotations

import base64
import hashlib
import zlib
from functools import lru_cache
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from jinja2 import Environment, FileSystemLoader, StrictUndefined

from pmg.pipeline.report.action_sheet import MARKS
from pmg.pipeline.report.draw import draw_all
from pmg.pipeline.report.theme import DARK, FONTS, LIGHT, variables
from pmg.pipeline.wording.safe_text import printable_lines

if TYPE_CHECKING:
    from pmg.pipeline.report.document import Report
    from pmg.pipeline.report.draw import Drawings
    from pmg.pipeline.report.figure import Figure

_TEMPLATES = Path(__file__).with_name("templates")
_SCRIPTS = ("page.js", "figures.js", "signals.js")


def html(report: Report, drawings: Drawings | None = None) -> str:
    """The page of a report, figures and scripts inside; links to data files are relative.

    Without scripts the page is whole: figures are still drawings then, and tables keep their order. Only the two
    scripts named by their hashes can run.

    Parameters
    ----------
    report : Report
        What is reported. All of its text is escaped.
    drawings : Drawings, optional
        Its figures, where they have been drawn already.
    """
    drawn = draw_all(report.figures) if drawings is None else drawings
    environment = Environment(
        loader=FileSystemLoader(_TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        keep_trailing_newline=True,
        finalize=_shown,
    )
    script = _script()
    library = _library() if report.figures else ""
    allowed = [script, library] if library else [script]
    return environment.get_template("report.html.j2").render(
        report=report,
        drawings={figure.id: _captioned(drawn.inline[figure.id], figure) for figure in report.figures},
        live=drawn.live,
        csv={table.id: _deflated(table.csv().encode("utf-8", "backslashreplace")) for table in report.tables},
        numbers={table.id: count for count, table in enumerate(report.tables, 1)}
        | {figure.id: count for count, figure in enumerate(report.figures, 1)},
        cited={
            section.id: sorted({report.bibliography.index(source) + 1 for source in section.sources})
            for section in report.sections
        },
        placed=report.titles,
        switchable=any(figure.switched for figure in report.figures),
        marks=MARKS,
        light=variables(LIGHT),
        dark=variables(DARK),
        fonts=FONTS,
        css=(_TEMPLATES / "report.css").read_text(encoding="utf-8"),
        allowed=" ".join(_hash(text) for text in allowed),
        plotly=_packed_library() if library else "",
        script=script,
    )


def _shown(value: object) -> object:
    """What a template prints of a value: of plain text, no sign that would steer the page or its reader's terminal."""
    return printable_lines(value) if type(value) is str else value


def _deflated(data: bytes) -> str:
    """Bytes as base64 of raw deflate, as the page unpacks them."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    return base64.b64encode(packer.compress(data) + packer.flush()).decode("ascii")


def _script() -> str:
    return "\n".join((_TEMPLATES / name).read_text(encoding="utf-8") for name in _SCRIPTS)


@lru_cache(maxsize=1)
def _library() -> str:
    """The drawing library's script, from its Python package, which need not be imported for that."""
    found = find_spec("plotly")
    assert found is not None, "plotly is a dependency of pmg"
    assert found.submodule_search_locations
    folder = Path(next(iter(found.submodule_search_locations)))
    return (folder / "package_data" / "plotly.min.js").read_text(encoding="utf-8")


@lru_cache(maxsize=1)
def _packed_library() -> str:
    return _deflated(_library().encode())


def _hash(script: str) -> str:
    """The script as a content security policy names it."""
    return f"'sha256-{base64.b64encode(hashlib.sha256(script.encode()).digest()).decode('ascii')}'"


def _captioned(svg: str, figure: Figure) -> str:
    """The figure drawn, with its caption for those who cannot see it.

    A drawing escapes its own text; only its opening tag is added to.
    """
    return svg.replace("<svg ", f'<svg class="drawing" role="img" aria-label="{escape(figure.caption)}" ', 1)
