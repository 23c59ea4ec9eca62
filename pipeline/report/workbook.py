"""A report as a workbook: contents, a sheet for each table with its units in a row of their own, the figures."""

from __future__ import annotations

import io
import math
import numbers
import re
import struct
from datetime import datetime
from typing import TYPE_CHECKING, Any

import numpy as np
from xlsxwriter import Workbook

from pmg.pipeline.report.spelled import spelled
from pmg.pipeline.report.table import Column, Measured, Table, lines, split
from pmg.pipeline.report.theme import LIGHT
from pmg.pipeline.wording import numerals

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from xlsxwriter.format import Format
    from xlsxwriter.worksheet import Worksheet

    from pmg.pipeline.report.document import Report
    from pmg.pipeline.report.table import Cell

CONTENTS = "contents"
FIGURES = "figures"
LONGEST_NAME = 31
LONGEST_TEXT = 32_767
MOST_ROWS = 1_048_576
"""Characters of a sheet's name, characters of a cell and rows of a sheet that Excel takes."""
HEAD = 2
"""Rows above the values of a table: headings and units."""
_TAKEN = (CONTENTS, FIGURES, "history")
"""Names that no table gets; Excel keeps the last for itself."""
_MADE = datetime(1980, 1, 1)
"""In place of the time of writing."""
_NARROWEST, _WIDEST = 8, 60
_ROW_POINTS, _POINTS = 15.0, 72.0
_SHOWN = re.compile(r"(?P<sign>\+?)[−-]?(?P<whole>[\d,]+)(?:\.(?P<decimals>\d+))?(?P<power>×10\S+)?(?P<percent>%?)")
_SCALED = re.compile(r"\((.*)\)(×10\S+)")


class _Exact(float):
    """A number that is written with all its digits; XlsxWriter would cut it at the sixteenth."""

    def __format__(self, spec: str) -> str:
        return repr(float(self)).upper() if spec.endswith("G") else super().__format__(spec)


def workbook(report: Report, pictures: Mapping[str, bytes]) -> bytes:
    """A report as a file of Excel's; the same report gives the same bytes.

    Numbers are stored in full precision and shown with the digits that the page shows: those that their
    uncertainty deserves. What is not finite has no number in Excel: NaN is an empty cell, infinity a text. Text is
    never taken for a formula, a number or a link. Filters stand in the row of units, so that sorting leaves it.

    Parameters
    ----------
    report : Report
        What is reported.
    pictures : mapping of str to bytes
        PNG of each figure by its file name.
    """
    file = io.BytesIO()
    taken = {"in_memory": True} | dict.fromkeys(("strings_to_numbers", "strings_to_formulas", "strings_to_urls"), False)
    with Workbook(file, taken) as book:
        book.set_properties({"title": spelled(report.title), "created": _MADE})
        styles = _Styles(book)
        names = _sheet_names(report.tables)
        _write_contents(book.add_worksheet(CONTENTS), report, names, styles)
        for table in report.tables:
            _write_table(book.add_worksheet(names[table.id]), table, styles)
        if report.figures:
            _write_figures(book.add_worksheet(FIGURES), report, pictures, styles)
    return file.getvalue()


def _sheet_names(tables: Iterable[Table]) -> dict[str, str]:
    """Name of each table's sheet by its id: the id itself, cut and counted where Excel wants it shorter or other."""
    ids = [table.id for table in tables]
    fit = {name for name in ids if len(name) <= LONGEST_NAME and name not in _TAKEN}
    taken = fit | set(_TAKEN)
    names: dict[str, str] = {}
    for name in ids:
        short, count = name[:LONGEST_NAME], 1
        while short in taken and name not in fit:
            count += 1
            ending = f"-{count}"
            short = name[: LONGEST_NAME - len(ending)] + ending
        taken.add(short)
        names[name] = short
    return names


def _number_format(text: str) -> str:
    """Excel's format that shows a number with as many digits as a text of `numerals.number` does."""
    shown = _SHOWN.fullmatch(text)
    if shown is None:
        return "General"
    decimals = f".{'0' * len(shown['decimals'])}" if shown["decimals"] else ""
    whole = "#,##0" if "," in shown["whole"] else "0"
    code = f"{whole}{decimals}{'E+00' if shown['power'] else ''}{shown['percent']}"
    return f"+{code};-{code};{code}" if shown["sign"] else code


def _number_formats(column: Column, cell: Cell) -> tuple[str, str]:
    """Excel's formats of a value and of its uncertainty, after the text that the page shows."""
    if not isinstance(cell, Measured) or math.isnan(cell.u):
        return _number_format(column.text(cell)), "General"
    text = column.text(cell)
    if scaled := _SCALED.fullmatch(text):
        value = _number_format(scaled[1].partition(" ± ")[0] + scaled[2])
        return value, "0.0E+00"
    value, _, u = text.partition(" ± ")
    return _number_format(value), _number_format(u)


class _Styles:
    """The styles of one workbook, each made once."""

    def __init__(self, book: Workbook) -> None:
        self._book = book
        self._made: dict[tuple[tuple[str, Any], ...], Format] = {}

    def __call__(self, **properties: Any) -> Format:  # noqa: ANN401 - properties as XlsxWriter names them
        key = tuple(sorted(properties.items()))
        if key not in self._made:
            self._made[key] = self._book.add_format(properties)
        return self._made[key]

    @property
    def heading(self) -> Format:
        return self(bold=True, text_wrap=True, valign="top", bg_color=LIGHT["soft"])

    @property
    def unit(self) -> Format:
        return self(italic=True, font_color=LIGHT["muted"], bg_color=LIGHT["soft"], bottom=1)

    @property
    def paragraph(self) -> Format:
        return self(text_wrap=True, valign="top")


def _write_contents(sheet: Worksheet, report: Report, names: dict[str, str], styles: _Styles) -> None:
    """Title, verdict, the sheets with what each shows, and where it all comes from."""
    state = report.verdict.state
    background = LIGHT[f"{state}-soft"] if f"{state}-soft" in LIGHT.colours else LIGHT["soft"]
    sheet.set_column(0, 0, LONGEST_NAME + 3)
    sheet.set_column(1, 2, 34)
    sheet.set_column(3, 3, 8)
    sheet.set_column(4, 4, 90)
    _text(sheet, 0, 0, report.title, styles(bold=True, font_size=16))
    _text(sheet, 1, 0, report.subtitle, styles(font_color=LIGHT["muted"]))
    verdict = styles(
        bold=True, font_color=LIGHT["good" if state == "good" else "ink"], bg_color=background, valign="top"
    )
    _text(sheet, 2, 0, report.verdict.label, verdict)
    style = styles(text_wrap=True, valign="top", bg_color=background)
    sheet.merge_range(2, 1, 2, 4, "", style)
    _text(sheet, 2, 1, report.verdict.text, style)
    sheet.set_row(2, _ROW_POINTS * (1 + len(report.verdict.text) // 150))
    row = 4
    for place, heading in enumerate(("Sheet", "Table", "Section", "Rows", "What it shows")):
        _text(sheet, row, place, heading, styles.heading)
    for section in report.sections:
        for table in (item for item in section.unfolded if isinstance(item, Table)):
            row += 1
            sheet.write_url(row, 0, f"internal:'{names[table.id]}'!A1", string=names[table.id])
            for place, text in ((1, table.title), (2, section.title), (4, _caption(table))):
                _text(sheet, row, place, text, styles.paragraph)
            sheet.write_number(row, 3, len(table.rows), styles(valign="top"))
    if report.figures:
        row += 1
        sheet.write_url(row, 0, f"internal:'{FIGURES}'!A1", string=FIGURES)
        _text(sheet, row, 1, f"{len(report.figures)} figures", styles.paragraph)
        _text(sheet, row, 4, "; ".join(figure.title for figure in report.figures), styles.paragraph)
    row += 2
    _text(sheet, row, 0, "Provenance", styles.heading)
    for label, value in report.provenance.shown:
        row += 1
        _text(sheet, row, 0, label, styles.paragraph)
        _text(sheet, row, 1, value, None)


def _caption(table: Table) -> str:
    left = len(table.rows) + HEAD - MOST_ROWS
    return table.caption if left <= 0 else f"{table.caption} The last {left} rows are in {table.file} alone."


def _write_table(sheet: Worksheet, table: Table, styles: _Styles) -> None:
    """Headings, units, and from the third row on the values; a column of uncertainties where any is stated."""
    place = 0
    for index, (column, pair, numeric) in enumerate(zip(table.columns, table.paired, table.numeric, strict=True)):
        cells = [row[index] for row in table.rows[: MOST_ROWS - HEAD]]
        for offset, heading in enumerate((column.heading, f"u({column.heading})")[: 1 + pair]):
            _text(sheet, 0, place + offset, heading, styles.heading)
            _text(sheet, 1, place + offset, column.unit, styles.unit)
        for row, cell in enumerate(cells, HEAD):
            value, u = split(cell)
            formats = _number_formats(column, cell)
            _cell(sheet, row, place, value, formats[0], styles)
            if pair:
                _cell(sheet, row, place + 1, u, formats[1], styles)
        sheet.set_column(place, place + pair, _width(column, cells, numeric=numeric))
        place += 1 + pair
    if table.columns:
        first = split(table.rows[0][0])[0] if table.rows else None
        sheet.freeze_panes(HEAD, 1 if isinstance(first, str) and len(table.columns) > 1 else 0)
        sheet.autofilter(HEAD - 1, 0, max(HEAD - 1, min(len(table.rows) + HEAD, MOST_ROWS) - 1), place - 1)


def _width(column: Column, cells: Sequence[Cell], *, numeric: bool) -> float:
    """Width of a column in characters: its longest value, and its heading in two lines or so."""
    shown = (column.text(cell).partition(" ± ")[0] if numeric else column.text(cell) for cell in cells)
    longest = max((len(line) for text in shown for line in text.split("\n")), default=0)
    words = max(map(len, re.split(r"[\s_]", f"u({column.heading})")))
    # Room for the arrow of the filter, which stands next to the unit.
    return min(max(longest + 2, words + 2, len(column.heading) // 2 + 4, len(column.unit) + 4, _NARROWEST), _WIDEST)


def _cell(sheet: Worksheet, row: int, place: int, value: Any, shown: str, styles: _Styles) -> None:  # noqa: ANN401
    """One value: a number, a truth, a text, or nothing."""
    if value is None or (isinstance(value, str) and not value):
        return
    if isinstance(value, str):
        _text(sheet, row, place, value, styles.paragraph if "\n" in value or len(value) > _WIDEST else None)
    elif isinstance(value, bool | np.bool_):
        sheet.write_boolean(row, place, bool(value))
    elif isinstance(value, numbers.Integral) or math.isfinite(float(value)):
        sheet.write_number(row, place, _Exact(value), styles(num_format=shown))
    elif not math.isnan(float(value)):
        _text(sheet, row, place, numerals.number(float(value)), styles(align="right"))


def _text(sheet: Worksheet, row: int, place: int, text: str, style: Format | None) -> None:
    """A text as it is, whatever it looks like; one too long for a cell ends by saying so."""
    whole = spelled(lines(text))
    ending = " … (cut: too long for a cell)"
    # Excel counts in units of UTF-16.
    if len(whole.encode("utf-16-le")) // 2 > LONGEST_TEXT:
        whole = whole.encode("utf-16-le")[: 2 * (LONGEST_TEXT - len(ending))].decode("utf-16-le", "ignore") + ending
    if whole:
        sheet.write_string(row, place, whole, style)
    elif style is not None:
        sheet.write_blank(row, place, None, style)


def _write_figures(sheet: Worksheet, report: Report, pictures: Mapping[str, bytes], styles: _Styles) -> None:
    """Every figure below its caption."""
    sheet.hide_gridlines(2)
    sheet.set_column(0, 0, 120)
    row = 0
    for count, figure in enumerate(report.figures, 1):
        _text(sheet, row, 0, f"Figure {count}. {figure.title}. {figure.caption}", styles.paragraph)
        png = pictures[figure.file]
        words = {"description": spelled(figure.caption)[:255], "object_position": 3}
        sheet.insert_image(row + 1, 0, figure.file, {"image_data": io.BytesIO(png)} | words)
        row += 3 + math.ceil(_height(png) * _POINTS / _ROW_POINTS)


def _height(png: bytes) -> float:
    """Height of a picture [in], by its own word on dots per metre."""
    (pixels,) = struct.unpack(">I", png[20:24])
    place = png.index(b"pHYs") + 4
    _, per_metre = struct.unpack(">II", png[place : place + 8])
    return float(pixels / (per_metre * 0.0254))
