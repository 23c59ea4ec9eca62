"""Summary of a report for programs: the JSON document ``pmg.summary/1``; its schema lies in this folder."""

from __future__ import annotations

import hashlib
import math
import numbers
from typing import TYPE_CHECKING, Any

import numpy as np

from pmg.pipeline.report.document import Figure
from pmg.pipeline.report.table import Table, split

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pmg.pipeline.report.document import Report
    from pmg.pipeline.report.table import Cell

    Plain = str | float | bool | None

SCHEMA = "pmg.summary/1"


def summary(report: Report, files: Mapping[str, bytes], facts: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """A report as a document of plain values; the same report gives the same document.

    Parameters
    ----------
    report : Report
        What is reported.
    files : mapping of str to bytes
        What the report consists of, by its path in the report's folder.
    facts : mapping, optional
        What the report's maker adds, as plain values. ``points`` is that of the points: how many were accepted, how
        many rejected. ``diagnosis``, the word of the diagnosis, is reported with the verdict.

    Returns
    -------
    dict
        Tables that stand on the page in full (40 rows or fewer) are reported with every value, its standard uncertainty
        (null where none is stated) and unit; longer ones by their file. NaN is null, infinity a string.
    """
    stated = dict(facts or {})
    word = stated.pop("diagnosis", None)
    placed = [(item, section.title) for section in report.sections for item in section.unfolded]
    return {
        "schema": SCHEMA,
        "title": report.title,
        "subtitle": report.subtitle,
        "verdict": {"state": report.verdict.state, "text": report.verdict.text}
        | ({} if word is None else {"diagnosis": word}),
        "facts": stated,
        "provenance": [{"label": label, "value": value} for label, value in report.provenance.shown],
        "tables": [_table(item, section) for item, section in placed if isinstance(item, Table)],
        "figures": [_figure(item, section) for item, section in placed if isinstance(item, Figure)],
        "files": [
            {"name": name, "bytes": len(files[name]), "sha256": hashlib.sha256(files[name]).hexdigest()}
            for name in sorted(files)
        ],
    }


def _table(table: Table, section: str) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "id": table.id,
        "title": table.title,
        "section": section,
        "finding": table.caption,
        "file": table.file,
        "columns": [
            {"name": column.name, "label": column.heading, "unit": column.unit, "u": pair}
            for column, pair in zip(table.columns, table.paired, strict=True)
        ],
        "count": len(table.rows),
    }
    if not table.long:
        entry["rows"] = [
            [_plain_cell(cell, pair=pair) for cell, pair in zip(row, table.paired, strict=True)] for row in table.rows
        ]
    return entry


def _figure(figure: Figure, section: str) -> dict[str, str]:
    return {
        "id": figure.id,
        "title": figure.title,
        "section": section,
        "finding": figure.caption,
        "png": figure.file,
        "svg": figure.vector_file,
    }


def _plain_cell(cell: Cell, *, pair: bool) -> Plain | dict[str, Plain]:
    value, u = (_plain(part) for part in split(cell))
    return {"value": value, "u": u} if pair else value


def _plain(value: object) -> Plain:
    """A value as JSON can tell it."""
    if value is None or isinstance(value, str):
        return value
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, numbers.Integral):
        return int(value)
    number = float(value)  # type: ignore[arg-type]
    if math.isnan(number):
        return None
    return number if math.isfinite(number) else str(number)
