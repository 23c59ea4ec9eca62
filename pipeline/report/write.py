"""A report written to a folder: the page, and next to it its figures, tables, workbook and summary."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from pmg.pipeline.files.atomic import write_atomic
from pmg.pipeline.files.parallel import begin
from pmg.pipeline.report.draw import draw_all
from pmg.pipeline.report.html import html
from pmg.pipeline.report.summary import summary
from pmg.pipeline.report.workbook import workbook
from pmg.sim.errors import StoreError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pmg.pipeline.report.document import Report

PAGE = "report.html"
SUMMARY = "summary.json"
WORKBOOK = "report.xlsx"
LISTING = "report-files.json"
"""Files of the report; the next one removes those it no longer makes, and nothing else."""

_OURS = re.compile(r"figures/[a-z0-9_-]+\.(png|svg)|tables/[a-z0-9_-]+\.csv|figures\.pdf|report\.xlsx|summary\.json")
"""Files of a report, and what earlier versions wrote."""


def report_files(report: Report, *, summed_up: bool = True) -> tuple[str, ...]:
    """Names of the files that `write_report` writes, the listing among them, in the order it gives them."""
    head = (PAGE, *(SUMMARY,) * summed_up, WORKBOOK)
    drawn = (*(figure.file for figure in report.figures), *(figure.vector_file for figure in report.figures))
    return (*head, *drawn, *(table.file for table in report.tables), LISTING)


def write_report(
    report: Report, folder: Path, facts: Mapping[str, Any] | None = None, *, summed_up: bool = True
) -> tuple[Path, ...]:
    """Write a report; the same report gives the same bytes.

    Parameters
    ----------
    report : Report
        What is reported.
    folder : Path
        Where; made when it is not there. Files of other origin are left alone.
    facts : mapping, optional
        What the summary tells in addition to the report; see `summary`.
    summed_up : bool
        Whether a summary is written; a caller that writes one of its own under that name says no.

    Returns
    -------
    tuple of Path
        The page, the summary, the workbook, the figures, the tables and the listing.

    Raises
    ------
    StoreError
        When the listing of an earlier report cannot be read.
    """
    earlier = _listed(folder / LISTING)
    drawn = draw_all(report.figures)
    made = drawn.files | {table.file: _encoded(table.csv()) for table in report.tables}
    book = begin(partial(workbook, replace(report, signals=None)), drawn.files)
    made |= {PAGE: _encoded(html(report, drawn)), WORKBOOK: book()}
    names = [name for name in report_files(report, summed_up=summed_up) if name != LISTING]
    if summed_up:
        summed = summary(report, {name: made[name] for name in names if name != SUMMARY}, facts)
        made[SUMMARY] = _encoded(json.dumps(summed, indent=1, allow_nan=False, ensure_ascii=False) + "\n")
    files = {name: made[name] for name in names}
    # Until all is in place the listing names both reports, so that a broken run leaves nothing unlisted.
    write_atomic(folder / LISTING, _listing(earlier | set(files)))
    for name, data in reversed(files.items()):
        write_atomic(folder / name, data)
    for name in sorted(earlier - set(files)):
        (folder / name).unlink(missing_ok=True)
    write_atomic(folder / LISTING, _listing(set(files)))
    return (*(folder / name for name in files), folder / LISTING)


def remove_report(folder: Path, others: tuple[str, ...] = ()) -> None:
    """Remove an earlier report that nothing makes anew, with others that stand beside it; what is not ours stays.

    Raises
    ------
    StoreError
        When its listing cannot be read.
    """
    if not (folder / LISTING).exists():
        return
    for name in (*sorted({*_listed(folder / LISTING), PAGE, *others}), LISTING):
        (folder / name).unlink(missing_ok=True)
    for each in (folder / "figures", folder / "tables", folder):
        if each.is_dir() and not any(each.iterdir()):
            each.rmdir()


def _encoded(text: str) -> bytes:
    """UTF-8; what it cannot hold (bytes of a file name that were no text) is spelled out."""
    return text.encode("utf-8", "backslashreplace")


def _listing(names: set[str]) -> bytes:
    return (json.dumps({"files": sorted(names)}, indent=1) + "\n").encode()


def _listed(path: Path) -> set[str]:
    """Files that an earlier report wrote with its page; names of any other form are not ours to remove."""
    if not path.exists():
        return set()
    try:
        names = json.loads(path.read_text(encoding="utf-8"))["files"]
        return {name for name in names if _OURS.fullmatch(name)}
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise StoreError(
            str(path),
            f"not a listing of report files ({type(error).__name__})",
            '{"files": [...]}',
            "Delete it; files of earlier reports then stay.",
        ) from error
