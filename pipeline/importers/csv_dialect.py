"""Dialect of a CSV file: encoding, separator, decimal sign, names and units of its columns.

Of these clevercsv finds the separator only: the same one in 224 files written for a comparison, in 0.3 s for a head of
256 KiB, at the price of three packages (8 MB). The separator is found here from the header and the rows below it.
"""

from __future__ import annotations

import codecs
import csv
import io
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

from pydantic import model_validator

from pmg.pipeline.files.strict_tables import Strict, one_of, refuse, within
from pmg.pipeline.importers.source import BRACKETED
from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

HEAD_BYTES = 1 << 18
"""So much of the file is looked at to find out how it is written [bytes]."""

BOMS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
LOOKED_AT = 20
"""Rows which decide whether the row above them holds units."""
PREAMBLE, FEWEST_ROWS = 100, 5
"""Lines above the names of the columns that may be about the file, and rows below that show where the table begins."""
DELIMITERS = (";", "\t", ",", "|")
"""Separators that are found without being declared, the earlier one first where two are equally frequent."""

SPELLED = {"\t": "tab", " ": "space"}
"""Separators that are named where they are declared."""

MISSING = ("", "nan", "NaN", "NAN", "null", "NULL", "n/a", "N/A", "-", "--", "---")
"""Words for a cell without a value."""

WORD_OF_FILE = re.compile(r"\s*(?P<key>[^:=;,\t]+?)\s*[:=]\s*(?P<value>.*?)[\s;,]*")
NUMBER = re.compile(r"[+-]?(\d+([.,]\d*)?|[.,]\d+)([eE][+-]?\d+)?")
THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")
"""A number that may be whole, with a comma between thousands, or have three decimals after it."""
WITH_COMMA, WITH_POINT = re.compile(r"\d,\d|^,\d"), re.compile(r"\d\.\d|^\.\d")


class CsvForm(Strict):
    """Dialect of a CSV file as the user states it; ``auto`` and None are found out.

    Parameters
    ----------
    encoding, delimiter, decimal : str
        How it is written.
    comment : str
        Start of lines that hold no data; empty for none.
    header_line : int, optional
        Line with the names of the columns, from 1 on; 0 for none, when columns are called ``1``, ``2`` and so on.
    units_row : str
        Whether a row of units follows the names: ``auto``, ``yes`` or ``no``.
    bad_rows : int
        Rows that may hold something that is no number; they become gaps.
    """

    encoding: Annotated[str, one_of("auto", "utf-8", "utf-16", "cp1252", "latin-1")] = "auto"
    delimiter: Annotated[str, one_of("auto", ";", ",", "\t", "|", " ")] = "auto"
    decimal: Annotated[str, one_of("auto", ".", ",")] = "auto"
    comment: str = "#"
    header_line: Annotated[int, within(0, 1_000_000)] | None = None
    units_row: Annotated[str, one_of("auto", "yes", "no")] = "auto"
    bad_rows: Annotated[int, within(0, 1_000_000)] = 0

    @model_validator(mode="after")
    def _two_signs(self) -> CsvForm:
        if self.delimiter == self.decimal == ",":
            do = "Have the recorder write ';' between cells, or leave one of the two keys to 'auto'."
            refuse("delimiter and decimal are both ','", "two different signs", do)
        return self


@dataclass(frozen=True)
class CsvHead:
    """Dialect of a CSV file.

    Parameters
    ----------
    encoding, delimiter, decimal : str
        Told or found.
    names, units : tuple of str
        Of the columns.
    units_line : int
        Line with units below the names, from 1 on; 0 for none.
    data_line : int
        First line with data, from 1 on.
    properties : mapping of str to str
        Lines ``# key: value`` above the data.
    """

    encoding: str
    delimiter: str
    decimal: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    units_line: int
    data_line: int
    properties: Mapping[str, str]

    def reading(self) -> dict[str, str]:
        """The same for a person, who can see by it what was taken for what."""
        return {
            "encoding": self.encoding,
            "delimiter": SPELLED.get(self.delimiter, self.delimiter),
            "decimal": self.decimal,
            "units_row": f"line {self.units_line}" if self.units_line else "none",
            "first_row": f"line {self.data_line}",
        }


def read_head(path: Path, form: CsvForm) -> CsvHead:
    """Dialect found in the file.

    Raises
    ------
    RecordingError
        When it has no line of names, or its decimal sign cannot be determined.
    """
    with path.open("rb") as stream:
        data = stream.read(HEAD_BYTES)
        whole = len(data) < HEAD_BYTES
    encoding = form.encoding if form.encoding != "auto" else _encoding(data)
    if encoding == "utf-8" and data.startswith(codecs.BOM_UTF8):
        encoding = "utf-8-sig"
    text = io.StringIO(data.decode(encoding, errors="replace"), newline=None)  # lines end where the reader ends them
    lines = [line.removesuffix("\n") for line in text]
    lines = lines if whole else lines[:-1]
    above = len(lines) if form.header_line is None else max(form.header_line - 1, 0)
    at = [n for n, line in enumerate(lines) if line.strip() and not (form.comment and line.startswith(form.comment))]
    if form.header_line:
        at = [n for n in at if n >= form.header_line]
        if form.header_line <= len(lines) and lines[form.header_line - 1].strip():
            at = [form.header_line - 1, *at]
            lines[at[0]] = lines[at[0]].removeprefix(form.comment).lstrip()
        else:
            came = "an empty line, or one beyond the head of the file"
            raise RecordingError(f"{path}, line {form.header_line}", came, "names of columns", "Correct header_line.")
    if form.header_line is None:
        at = at[_about_the_file([lines[n] for n in at[: PREAMBLE + LOOKED_AT]], form.delimiter) :]
    if not at:
        raise RecordingError(str(path), "no line with data", "names of columns and samples", "Look into the file.")
    delimiter = form.delimiter if form.delimiter != "auto" else _delimiter([lines[n] for n in at[: 1 + LOOKED_AT]])
    cells = cells_of(lines[at[0]], delimiter)
    if form.header_line == 0:
        names, units, begin = [str(n) for n in range(1, len(cells) + 1)], [""] * len(cells), at[0]
    else:
        names, units, begin = *_named(cells, path, at[0] + 1), at[0] + 1
    data_at = [n for n in range(begin, len(lines)) if holds_row(lines[n], form.comment, delimiter, len(names))]
    units_line = 0
    if form.header_line != 0 and data_at and form.units_row != "no":
        row = cells_of(lines[data_at[0]], delimiter)
        below = [cells_of(lines[n], delimiter) for n in data_at[1 : 1 + LOOKED_AT]]
        if form.units_row == "yes" or _are_units(row, below, len(names)):
            given = [cell.strip().strip("[]()").strip() for cell in row] + [""] * len(names)
            units = [given[n] or units[n] for n in range(len(names))]
            units_line = data_at[0] + 1
            data_at = data_at[1:]
    rows = [(n + 1, lines[n]) for n in data_at]
    decimal = form.decimal if form.decimal != "auto" else _decimal(rows, delimiter, path)
    first = data_at[0] + 1 if data_at else len(lines) + 1
    properties = _properties(lines[: min(above, first - 1)], form.comment, at[0])
    return CsvHead(encoding, delimiter, decimal, tuple(names), tuple(units), units_line, first, properties)


def cells_of(line: str, delimiter: str) -> list[str]:
    """The cells of one line; quotes count for nothing in a line that holds a cell longer than any recorder writes."""
    try:
        return next(csv.reader([line], delimiter=delimiter, skipinitialspace=delimiter == " "))
    except csv.Error:
        return line.split(delimiter)


def holds_row(line: str, comment: str, delimiter: str, columns: int) -> bool:
    """Whether a line holds a row; one that begins like a comment and has all its cells is a row with a bad cell."""
    if comment and line.startswith(comment):
        return columns > 1 and line.count(delimiter) == columns - 1
    return bool(line) and not line.isspace()


def _encoding(data: bytes) -> str:
    for mark, name in BOMS:
        if data.startswith(mark):
            return name
    try:
        codecs.getincrementaldecoder("utf-8")().decode(data, final=False)
    except UnicodeDecodeError:
        return "cp1252"
    return "utf-8"


def _delimiter(lines: list[str]) -> str:
    """The separator that stands in the header as often as in the rows below it, and most often there."""
    header, *rows = (re.sub(r'"[^"]*"', "", line) for line in lines)

    def fits(sign: str) -> tuple[bool, int, int]:
        count = header.count(sign)
        return count > 0, sum(row.count(sign) == count for row in rows), count

    return max(DELIMITERS, key=fits)


def _about_the_file(lines: list[str], delimiter: str) -> int:
    """Lines above the first one without a number that has a cell for each that the rows below it, of as many, have."""
    for first in range(min(PREAMBLE, len(lines) - FEWEST_ROWS)):
        some = lines[first : first + 1 + LOOKED_AT]
        sign = _delimiter(some) if delimiter == "auto" else delimiter
        rows = [cells_of(line, sign) for line in some]
        if len({len(row) for row in rows}) > 1 or len(rows[0]) == 1:
            continue
        held = [k for k in range(len(rows[0])) if any(row[k].strip() for row in rows[1:])]

        def full(cells: list[str], held: list[int] = held, count: int = len(rows[0])) -> bool:
            return len(cells) == count and all(cells[k].strip() for k in held)

        if full(rows[0]):
            above = ((k, cells_of(line, sign)) for k, line in enumerate(lines[:first]))
            fallback = 0 if any(map(_is_number, rows[0])) else first
            return next((k for k, cells in above if full(cells) and not any(map(_is_number, cells))), fallback)
    return 0


def _named(cells: list[str], path: Path, line: int) -> tuple[list[str], list[str]]:
    """Names and units from the cells of the header; a name that comes again gets a number."""
    if all(NUMBER.fullmatch(cell.strip()) for cell in cells):
        came = "numbers where the names of the columns should stand"
        do = "Say in [csv] which header_line holds them; 0 where there is none."
        raise RecordingError(f"{path}, line {line}", came, "names of columns", do)
    names: list[str] = []
    units: list[str] = []
    for cell in cells:
        match = BRACKETED.fullmatch(cell)
        plain = (match["name"] if match else cell).strip()
        count = sum(name.split("#")[0] == plain for name in names)
        names.append(f"{plain}#{count + 1}" if count else plain)
        units.append(match["unit"].strip() if match else "")
    return names, units


def _are_units(row: list[str], below: list[list[str]], columns: int) -> bool:
    """Whether a row below the names holds units: no number in it, and a word above numbers."""
    plain = [cell.strip() for cell in row]
    if len(row) != columns or any(_is_number(cell) for cell in plain if cell != "1"):
        return False
    words = [n for n, cell in enumerate(plain) if cell not in MISSING and cell != "1"]
    return any(not below or any(len(cells) > n and _is_number(cells[n].strip()) for cells in below) for n in words)


def _is_number(text: str) -> bool:
    cell = text.strip()
    return bool(NUMBER.fullmatch(cell) or THOUSANDS.fullmatch(cell)) or cell.lower() in ("nan", "inf")


def _decimal(rows: list[tuple[int, str]], delimiter: str, path: Path) -> str:
    """The decimal sign, from the cells that are numbers; a point where none has a fraction."""
    comma = point = decimal = 0
    shown = ""
    for line, text in rows:
        if point and ('"' if delimiter == "," else ",") not in text:
            continue  # no cell of it can hold a comma
        cells = [cell.strip() for cell in cells_of(text, delimiter)]
        numbers = [cell for cell in cells if NUMBER.fullmatch(cell) or THOUSANDS.fullmatch(cell)]
        with_comma = [cell for cell in numbers if WITH_COMMA.search(cell)]
        if with_comma and not comma:
            comma, shown = line, with_comma[0]
        decimal = decimal or any(not THOUSANDS.fullmatch(cell) for cell in with_comma)
        point = point or (line if any(map(WITH_POINT.search, numbers)) else 0)
    if comma and point:
        came = f"a decimal point here and a decimal comma in line {comma}"
        do = "Say in [csv] which it is: decimal = ',' or '.'."
        raise RecordingError(f"{path}, line {point}", came, "one decimal sign", do)
    if comma and not decimal:
        came = f"'{shown}', and all other numbers with a comma are such: it may stand before decimals or thousands"
        do = "Say in [csv] decimal = ',' where it is the decimal sign; else write the file without thousands' commas."
        raise RecordingError(f"{path}, line {comma}", came, "a decimal sign that can be determined", do)
    return "," if comma else "."


def _properties(lines: list[str], comment: str, header: int) -> dict[str, str]:
    """Facts in lines above the data, written as ``key: value``."""
    found: dict[str, str] = {}
    for n, line in enumerate(lines):
        marked = bool(comment) and line.startswith(comment)
        match = WORD_OF_FILE.fullmatch(line.removeprefix(comment) if marked else line)
        if match and (marked or n < header):
            found[match["key"]] = match["value"]
    return found
