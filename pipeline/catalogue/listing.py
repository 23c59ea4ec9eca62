"""Rows as text: aligned columns for a terminal, or comma-separated values."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING

from pmg.pipeline.catalogue.columns import Column, Kind
from pmg.pipeline.wording.safe_text import printable, spreadsheet_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.catalogue.entries import Cell

DIGITS = {"rpm": 1, "N m": 4, "s": 3}
"""Decimals on a terminal, by unit; CSV and JSON hold every digit."""


def aligned(columns: Sequence[Column], rows: Sequence[Sequence[Cell]]) -> list[str]:
    """A heading and one line a row; numbers to the right."""
    cells = [[column.name for column in columns]]
    cells += [[shown(column, value) for column, value in zip(columns, row, strict=True)] for row in rows]
    return aligned_cells(cells, [column.kind is Kind.NUMBER for column in columns])


def aligned_cells(cells: Sequence[Sequence[str]], right: Sequence[bool]) -> list[str]:
    """One line a row of texts, each column as wide as its widest; those to the right begin with blanks."""
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return [
        "  ".join(
            text.rjust(width) if left else text.ljust(width)
            for text, width, left in zip(line, widths, right, strict=True)
        ).rstrip()
        for line in cells
    ]


def shown(column: Column, value: Cell) -> str:
    """A value for a terminal; a dash where it is not known."""
    if value is None:
        return "-"
    if column.kind is Kind.FLAG:
        return "yes" if value else "no"
    if isinstance(value, float):
        digits = DIGITS.get(column.unit)
        if digits is None or column.name == "load":
            return f"{value:g}"
        return f"{value:.2g}" if column.name.startswith(("u_", "common_")) else f"{value:.{digits}f}"
    return printable(str(value))


def comma_separated(columns: Sequence[Column], rows: Sequence[Sequence[Cell]]) -> list[str]:
    """A heading and the rows; yes and no as such, empty where a value is not known."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow([column.name for column in columns])
    for row in rows:
        writer.writerow([_plain(column, value) for column, value in zip(columns, row, strict=True)])
    return stream.getvalue().removesuffix("\n").split("\n")


def _plain(column: Column, value: Cell) -> Cell:
    """A value for a table."""
    if column.kind is Kind.FLAG and value is not None:
        return "yes" if value else "no"
    return spreadsheet_text(value) if isinstance(value, str) else value


def for_json(column: Column, value: Cell) -> Cell:
    """A value for JSON, flags as such."""
    return bool(value) if column.kind is Kind.FLAG and value is not None else value
