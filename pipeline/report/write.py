"""A report written to a folder: the page, and beside it every figure as PNG and every table as CSV."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING

from pmg.pipeline.aside import write_aside
from pmg.pipeline.report.draw import draw_png
from pmg.pipeline.report.html import html
from pmg.sim.errors import StoreError

if TYPE_CHECKING:
    from pathlib import Path

    from pmg.pipeline.report.document import Report

PAGE = "report.html"
LISTING = "report-files.json"
"""What the report consists of; the next one removes what it no longer contains, and nothing else."""

_OURS = re.compile(r"figures/[a-z0-9_-]+\.png|tables/[a-z0-9_-]+\.csv")


def write_report(report: Report, folder: Path) -> tuple[Path, ...]:
    """Write a report; the same report gives the same bytes.

    Parameters
    ----------
    report : Report
        What is told.
    folder : Path
        Where; made when it is not there. Files of other origin are left alone.

    Returns
    -------
    tuple of Path
        The page, the figures, the tables and the listing.

    Raises
    ------
    StoreError
        When the listing of an earlier report cannot be read.
    """
    earlier = _listed(folder / LISTING)
    files = {PAGE: _encoded(html(report))}
    files |= {figure.file: draw_png(figure) for figure in report.figures}
    files |= {table.file: _encoded(table.csv()) for table in report.tables}
    # Until all is in place the listing names both reports, so that a broken run leaves nothing unlisted.
    write_aside(folder / LISTING, _listing(earlier | set(files)))
    for name, data in reversed(files.items()):
        write_aside(folder / name, data)
    for name in sorted(earlier - set(files)):
        (folder / name).unlink(missing_ok=True)
    write_aside(folder / LISTING, _listing(set(files)))
    return (*(folder / name for name in files), folder / LISTING)


def _encoded(text: str) -> bytes:
    """UTF-8; what it cannot hold (bytes of a file name that were no text) is spelled out."""
    return text.encode("utf-8", "backslashreplace")


def _listing(names: set[str]) -> bytes:
    return (json.dumps({"files": sorted(names)}, indent=1) + "\n").encode()


def _listed(path: Path) -> set[str]:
    """Figures and tables that an earlier report wrote; names of any other form are not ours to remove."""
    if not path.exists():
        return set()
    try:
        names = json.loads(path.read_text(encoding="utf-8"))["files"]
        return {name for name in names if _OURS.fullmatch(name)}
    except (ValueError, KeyError, TypeError) as error:
        raise StoreError(
            str(path),
            f"not a listing of report files ({type(error).__name__})",
            '{"files": [...]}',
            "Delete it; files of earlier reports then stay.",
        ) from error
