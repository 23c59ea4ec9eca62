"""The workbook of a report, read back by openpyxl."""

from __future__ import annotations

import io
import math
import zipfile
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
import openpyxl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pmg.pipeline.report import workbook as module
from pmg.pipeline.report.document import Column, Facts, Headline, Measured, Report, Section, Table
from pmg.pipeline.report.draw import draw_all
from pmg.pipeline.report.workbook import LONGEST_NAME, LONGEST_TEXT, _number_format, _sheet_names, workbook

from . import example

if TYPE_CHECKING:
    from openpyxl import Workbook
    from openpyxl.worksheet.worksheet import Worksheet

    from pmg.pipeline.report.document import Cell

FORMULAS = ("=1+1", "=cmd|' /C calc'!A0", "@SUM(A1)", "+1", "-1", "{=A1}", "http://example.org", "mailto:a@b.c", "007")
"""Text that a spreadsheet might take for something else."""
TEXTS = st.text(st.characters(codec="utf-8", exclude_categories=("Cs", "Cc")), min_size=1, max_size=20)
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)


def read(data: bytes) -> Workbook:
    return openpyxl.load_workbook(io.BytesIO(data))


def told(*tables: Table) -> Report:
    section = Section("one", "One", tables)
    return Report("Title", "", Headline("Fine.", "good"), (section,), Facts((("Seed", 1),)))


def table(rows: tuple[tuple[Cell, ...], ...], *columns: Column, name: str = "t") -> Table:
    return Table(name, "T", "C.", columns or (Column("x", "X", "W"),), rows)


def sheet(*rows: tuple[Cell, ...], columns: tuple[Column, ...] = ()) -> Worksheet:
    return read(workbook(told(table(rows, *columns)), {}))["t"]


def links(found: Worksheet) -> list[str | None]:
    """Where the links of a sheet lead inside the workbook; None for one that leads out of it."""
    return [cell.hyperlink.location for row in found.iter_rows() for cell in row if cell.hyperlink]


@cache
def pictures() -> dict[str, bytes]:
    return draw_all(example.report().figures).files


@cache
def example_data() -> bytes:
    return workbook(example.report(), pictures())


def test_headings_and_units_have_a_row_each_and_an_uncertainty_its_own_column() -> None:
    found = read(example_data())["points"]
    rows = list(found.iter_rows(max_row=4, values_only=True))
    assert rows[0] == ("Test point", "Total loss", "u(Total loss)", "Remark of the bench operator")
    assert rows[1] == (None, "W", "W", None)
    assert rows[2] == ("g1-000", 20, None, "window shortened at its end")
    assert rows[3] == ("g1-001", 20 + 1.2345, 0.3, "window shortened at its end")
    assert found.max_row == 2 + 120


def test_headings_stay_in_view_and_filters_leave_the_units_where_they_are() -> None:
    found = read(example_data())["points"]
    assert found.freeze_panes == "B3"
    assert found.auto_filter.ref == "A2:D122"
    assert sheet((1.0,)).freeze_panes == "A3"


@settings(max_examples=40)
@given(st.lists(st.tuples(NUMBERS, st.floats(0.0, 1e300)), min_size=1, max_size=20))
def test_numbers_come_back_to_the_last_bit(pairs: list[tuple[float, float]]) -> None:
    found = sheet(*((Measured(value, u),) for value, u in pairs))
    assert list(found.iter_rows(min_row=3, values_only=True)) == pairs


def test_integers_truths_and_numpy_scalars_keep_their_type() -> None:
    found = sheet((7,), (True,), (np.bool_(False),), (np.float64(0.1) + np.float64(0.2),), (np.int64(-3),))
    assert [row[0] for row in found.iter_rows(min_row=3, values_only=True)] == [7, True, False, 0.1 + 0.2, -3]


def test_what_is_absent_is_empty_and_infinity_is_told() -> None:
    found = sheet((math.nan,), (None,), ("",), (Measured(1.0, math.nan),), (math.inf,), (-math.inf,), (2.0,))
    rows = list(found.iter_rows(min_row=3, values_only=True))
    assert rows == [(None, None)] * 3 + [(1.0, None), ("∞", None), ("−∞", None), (2.0, None)]


@pytest.mark.parametrize("text", FORMULAS)
def test_text_stays_text_wherever_it_stands(text: str) -> None:
    made = replace(told(table(((text,),), Column("x", text, text))), title=text, subtitle=text, verdict=Headline(text))
    data = workbook(replace(made, provenance=Facts(((text, text),))), {})
    book = read(data)
    cells = [cell for found in book for row in found.iter_rows() for cell in row if cell.value == text]
    assert len(cells) == 3 + 2 + 3
    assert {cell.data_type for cell in cells} == {"s"}
    with zipfile.ZipFile(io.BytesIO(data)) as parts:
        sheets = [parts.read(name) for name in parts.namelist() if name.startswith("xl/worksheets/sheet")]
    assert not any(b"<f>" in part for part in sheets)
    assert [links(found) for found in book] == [["'t'!A1"], []]


@settings(max_examples=40)
@given(TEXTS)
def test_any_text_comes_back(text: str) -> None:
    assert sheet((text,)).cell(3, 1).value == text


def test_text_that_no_file_can_hold_is_spelled_out_and_a_long_one_says_that_it_is_cut() -> None:
    odd = b"run_\xff.mcap".decode("utf-8", "surrogateescape")
    found = sheet((odd,), ("a\x00b",), ("a\r\nb\rc",), ("x" * LONGEST_TEXT,), ("𝜏" * LONGEST_TEXT,))
    values = [str(row[0]) for row in found.iter_rows(min_row=3, values_only=True)]
    assert values[:3] == ["run_\\udcff.mcap", "a\\u0000b", "a\nb\nc"]
    assert values[3] == "x" * LONGEST_TEXT
    assert values[4].endswith("cut: too long for a cell)")
    assert len(values[4].encode("utf-16-le")) // 2 <= LONGEST_TEXT


def test_rows_beyond_what_a_sheet_holds_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST_ROWS", 5)
    book = read(workbook(told(table(tuple((float(i),) for i in range(7)))), {}))
    assert [row[0] for row in book["t"].iter_rows(min_row=3, values_only=True)] == [0.0, 1.0, 2.0]
    assert "The last 4 rows are in tables/t.csv alone." in str(book["contents"].cell(6, 5).value)


IDS = st.builds(
    lambda length, ending: "contentsorfiguresorhistoryofthegears"[:length] + ending,
    st.sampled_from([1, 8, 28, 29, 30, 31, 32, 35]),
    st.sampled_from(["", "-2", "-3", "-x"]),
) | st.sampled_from(["contents", "figures", "history", "contents-2"])


@given(st.lists(IDS, max_size=12, unique=True))
def test_names_of_sheets_are_legal_and_unique(ids: list[str]) -> None:
    names = _sheet_names([table((), name=name) for name in ids])
    assert list(names) == ids
    assert len(set(names.values())) == len(names)
    assert not {"contents", "figures", "history"} & set(names.values())
    assert all(0 < len(name) <= LONGEST_NAME for name in names.values())
    kept = {name for name in ids if len(name) <= LONGEST_NAME} - {"contents", "figures", "history"}
    assert all(names[name] == name for name in kept)


@pytest.mark.parametrize(
    ("cell", "shown"),
    [
        (Measured(0.97384, 0.00113), ("0.0000", "0.0000")),
        (Measured(-12.345, 3.2), ("0.0", "0.0")),
        (Measured(12345.6, 321.0), ("0", "0")),
        (Measured(1.2345e-9, 1.2e-11), ("0.000E+00", "0.0E+00")),
        (1234.5678, ("0", "General")),
        (0.012345678, ("0.00000", "General")),
        (1.2345e12, ("0.000E+00", "General")),
        (Measured(2.5, math.nan), ("0.0", "General")),
    ],
)
def test_a_cell_shows_the_digits_that_the_page_shows(cell: Cell, shown: tuple[str, str]) -> None:
    assert module._number_formats(Column("x"), cell) == shown
    found = sheet((cell,))
    assert found.cell(3, 1).number_format == shown[0]


def test_formats_of_signs_percents_and_thousands() -> None:
    assert [_number_format(text) for text in ("+1.20", "95.3%", "1,234.5", "−7", "–", "∞")] == [
        "+0.00;-0.00;0.00",
        "0.0%",
        "#,##0.0",
        "0",
        "General",
        "General",
    ]


def test_contents_lead_to_every_sheet_and_tell_verdict_and_provenance() -> None:
    book = read(example_data())
    assert book.sheetnames == ["contents", "points", "figures"]
    found = book["contents"]
    assert [found.cell(row, 1).value for row in (1, 2, 3)] == [
        "Losses of a gearbox",
        "Campaign of spring",
        "Needs attention",
    ]
    assert found["B3"].value == "A drag that grows with speed is missing."
    assert links(found) == ["'points'!A1", "'figures'!A1"]
    labels = {row[0]: row[1] for row in found.iter_rows(values_only=True)}
    assert labels["Recording"] == "raw/run_01.mcap"
    assert labels["points"] == "All points"


def test_figures_stand_below_their_captions_and_apart() -> None:
    report = example.report()
    found = read(example_data())["figures"]
    captions = {cell.row: cell.value for (cell,) in found.iter_rows() if cell.value}
    assert list(captions.values()) == [
        f"Figure {count}. {figure.title}. {figure.caption}" for count, figure in enumerate(report.figures, 1)
    ]
    images = found._images  # type: ignore[attr-defined]
    places = [(image.anchor._from.row + 1, image.anchor.to.row + 1) for image in images]
    assert [top for top, _ in places] == [row + 1 for row in captions]
    assert all(bottom < row for (_, bottom), row in zip(places, list(captions)[1:], strict=False))
    with zipfile.ZipFile(io.BytesIO(example_data())) as parts:
        stored = {parts.read(name) for name in parts.namelist() if name.endswith(".png")}
    assert stored == {pictures()[figure.file] for figure in report.figures}


def test_the_same_report_gives_the_same_workbook() -> None:
    assert workbook(example.report(), pictures()) == example_data()
    with zipfile.ZipFile(io.BytesIO(example_data())) as parts:
        assert {part.date_time for part in parts.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        assert b"1980-01-01T00:00:00Z" in parts.read("docProps/core.xml")


def test_a_report_without_tables_or_figures_has_its_contents() -> None:
    assert read(workbook(told(), {})).sheetnames == ["contents"]
    empty = read(workbook(told(table((), Column("x")), table((), Column("y"), name="u")), {}))
    assert empty["t"].max_row == 1 + 1 or empty["t"].max_row == 1
    assert empty["t"]["A1"].value == "x"
