"""Tables: typed columns, values with their uncertainty, and the same table as CSV in full precision."""

from __future__ import annotations

import csv
import io
import math
import numbers
from dataclasses import dataclass, field
from functools import cached_property
from typing import SupportsFloat, TypeAlias

import numpy as np

from pmg.pipeline.report.names import checked_id
from pmg.pipeline.wording import numerals
from pmg.pipeline.wording.safe_text import spreadsheet_text

LONG = 40
"""Rows above which a table scrolls in its own box."""


@dataclass(frozen=True)
class Measured:
    """A value with its standard uncertainty.

    Parameters
    ----------
    value : float
        Best estimate, in the unit of its column.
    u : float
        Standard uncertainty in the same unit; NaN where none is stated.
    """

    value: float
    u: float

    def __post_init__(self) -> None:
        if self.u < 0:
            raise ValueError(f"Measured({self.value}, {self.u}): an uncertainty is zero or more")


Cell: TypeAlias = "str | SupportsFloat | Measured | None"
"""Content of a cell; numpy scalars count as numbers, and None as absent."""


@dataclass(frozen=True)
class Column:
    """A column: what it is called, and how its values are shown.

    Parameters
    ----------
    name : str
        Name in the CSV file.
    label : str
        Heading for people; the name when empty.
    unit : str
        Unit of the values as given, empty for text and pure numbers.
    digits : int, optional
        Decimals after the point for values without an uncertainty.
    format : str
        Format specification instead of ``digits``.
    uncertain : bool
        Whether a value ought to carry an uncertainty; one that does not is marked.
    """

    name: str
    label: str = ""
    unit: str = ""
    digits: int | None = None
    format: str = ""
    uncertain: bool = False

    def __post_init__(self) -> None:
        if self.digits is not None and self.format:
            raise ValueError(f"Column {self.name!r}: give digits or format, not both")

    @property
    def heading(self) -> str:
        """Label, or the name where there is none."""
        return self.label or self.name

    def text(self, cell: Cell) -> str:
        """The cell as people read it."""
        value = cell
        if isinstance(value, Measured):
            if not math.isnan(value.u):
                return numerals.measured(float(value.value), float(value.u))
            value = value.value
        if value is None:
            return numerals.MISSING
        if isinstance(value, str):
            return value or numerals.MISSING
        if isinstance(value, bool | np.bool_):
            return "yes" if value else "no"
        if isinstance(value, numbers.Integral) and self.digits is None and not self.format:
            return str(int(value)).replace("-", "−")
        return numerals.number(float(value), self.digits, self.format)

    def unstated(self, cell: Cell) -> bool:
        """Whether the cell holds a number that lacks the uncertainty its column asks for."""
        if not self.uncertain or cell is None or isinstance(cell, str):
            return False
        if isinstance(cell, Measured):
            return math.isnan(cell.u) and not math.isnan(cell.value)
        return not math.isnan(float(cell))


@dataclass(frozen=True)
class Table:
    """A table with its finding as caption.

    Parameters
    ----------
    id : str
        Anchor and file name, unique in the report.
    title : str
        Short name.
    caption : str
        What the table shows, as a sentence.
    columns : tuple of Column
        The columns.
    rows : tuple of tuple
        One `Cell` per column.
    """

    id: str
    title: str
    caption: str
    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...] = field(repr=False)

    def __post_init__(self) -> None:
        checked_id("Table", self.id)
        for index, row in enumerate(self.rows):
            if len(row) != len(self.columns):
                raise ValueError(f"Table {self.id!r}: row {index} has {len(row)} cells for {len(self.columns)} columns")

    @property
    def file(self) -> str:
        """Path of the CSV file inside the report's folder."""
        return f"tables/{self.id}.csv"

    @property
    def long(self) -> bool:
        """Whether the table scrolls in its own box."""
        return len(self.rows) > LONG

    @property
    def marked(self) -> bool:
        """Whether any value lacks an uncertainty it ought to have."""
        return any(column.unstated(cell) for row in self.rows for column, cell in zip(self.columns, row, strict=True))

    @cached_property
    def drawn(self) -> tuple[int, ...]:
        """Places of the columns that a page shows: those that hold anything; files keep them all."""
        columns = enumerate(zip(self.columns, self._cells_by_column(), strict=True))
        return tuple(
            k
            for k, (column, cells) in columns
            if not cells or any(column.text(cell) != numerals.MISSING for cell in cells)
        )

    @property
    def numeric(self) -> tuple[bool, ...]:
        """Which columns hold numbers only, and are aligned to the right."""
        return tuple(
            any(cell is not None for cell in cells)
            and not any(isinstance(cell, str | bool | np.bool_) for cell in cells)
            for cells in self._cells_by_column()
        )

    @cached_property
    def paired(self) -> tuple[bool, ...]:
        """Which columns are followed by one of uncertainties in a file: those where any is stated."""
        return tuple(any(isinstance(cell, Measured) for cell in cells) for cells in self._cells_by_column())

    def csv(self) -> str:
        """The table in full precision; a column of uncertainties follows wherever one is stated.

        Returns
        -------
        str
            Comma separated, one header line ``name [unit]``; an absent value is an empty field, and every
            line break within a text is a line feed.
        """
        sheet = io.StringIO()
        writer = csv.writer(sheet, lineterminator="\n")
        header: list[str] = []
        for column, pair in zip(self.columns, self.paired, strict=True):
            unit = f" [{column.unit}]" if column.unit else ""
            header += [f"{name}{unit}" for name in ((column.name, f"u({column.name})")[: 1 + pair])]
        writer.writerow(header)
        for row in self.rows:
            line: list[str] = []
            for cell, pair in zip(row, self.paired, strict=True):
                line += [_exact(part) for part in split(cell)[: 1 + pair]]
            writer.writerow(line)
        return sheet.getvalue()

    def _cells_by_column(self) -> list[tuple[Cell, ...]]:
        return [tuple(row[index] for row in self.rows) for index in range(len(self.columns))]


def split(cell: Cell) -> tuple[str | SupportsFloat | None, float | None]:
    """The value of a cell and its standard uncertainty; None where there is none."""
    return (cell.value, cell.u) if isinstance(cell, Measured) else (cell, None)


def lines(text: str) -> str:
    """The text with a line feed for every line break."""
    return "\n".join(text.replace("\r\n", "\n").split("\r"))


def _exact(value: str | SupportsFloat | None) -> str:
    """The shortest text that reads back as the same value."""
    if value is None:
        return ""
    if isinstance(value, str):
        return spreadsheet_text(lines(value))
    if isinstance(value, bool | np.bool_):
        return "true" if value else "false"
    if isinstance(value, numbers.Integral):
        return str(int(value))
    number = float(value)
    return "" if math.isnan(number) else repr(number)
