"""The frame of a page for the bench: it holds no script and asks for nothing, in light and in dark colours."""

from __future__ import annotations

from html import escape

from pmg.pipeline.report.theme import DARK, FONTS, LIGHT, variables
from pmg.pipeline.wording.safe_text import printable

POLICY = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"
"""What a browser may load for the page: nothing but the page itself."""

SHEET_STYLE = """
body{font-size:13px;line-height:1.4;max-width:72rem}
h1{font-size:1.3rem;margin:0 0 .2rem}p,ul{margin:.25rem 0}ul{padding-left:1.2rem}
table{width:100%;margin-top:.5rem}th,td{border:1px solid var(--rule);padding:.16rem .4rem;text-align:left}
th{font-weight:600;vertical-align:bottom;background:var(--soft)}tr{break-inside:avoid}
.box{display:inline-block;width:.8em;height:.8em;border:1px solid var(--ink);vertical-align:-.08em}
.line{display:inline-block;min-width:9rem;border-bottom:1px solid var(--ink)}thead{display:table-header-group}
@page{size:A4 landscape;margin:11mm}
@media print{body{font-size:var(--letters,9.5px);padding:0;max-width:none}h1{font-size:14px}}
"""
"""Rules of a sheet to print, with boxes to tick and lines to write on; `--letters` is the size of its letters."""


def framed(title: str, body: str, style: str, refresh: int | None = None) -> str:
    """A whole page as HTML.

    Parameters
    ----------
    title : str
        Its name, as plain text.
    body : str
        What it shows, as HTML.
    style : str
        Rules beside the colours and fonts of a report.
    refresh : int, optional
        Time after which the browser asks for it again [s]; never if not given.
    """
    again = "" if refresh is None else f'<meta http-equiv="refresh" content="{refresh}">'
    return f"""<!DOCTYPE html>
<html lang="en"><head><meta charset="utf-8">{again}
<meta http-equiv="Content-Security-Policy" content="{POLICY}">
<meta name="viewport" content="width=device-width, initial-scale=1"><title>{as_html(title)}</title>
<link rel="icon" href="data:,"><style>:root{{{variables(LIGHT)} --fonts:{FONTS};color-scheme:light dark}}
@media screen and (prefers-color-scheme:dark){{:root{{{variables(DARK)}}}}}
body{{font-family:var(--fonts);color:var(--ink);background:var(--paper);margin:0 auto;padding:1rem}}
table{{border-collapse:collapse}}.muted{{color:var(--muted)}}{style}</style></head>
<body>{body}</body></html>
"""


def as_html(words: object) -> str:
    """Text that is no markup, with no sign that steers a terminal or the page."""
    return escape(printable(str(words)))
