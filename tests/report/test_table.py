"""Tables on the page and as CSV."""

from __future__ import annotations

import csv
import io
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pmg.pipeline.report.document import Cell, Column, Measured, Table
from pmg.pipeline.wording.safe_text import spreadsheet_text

TEXTS = st.text(st.characters(exclude_characters="\r"))
FINITE = st.floats(allow_nan=False)


def table(*rows: tuple[Cell, ...], columns: tuple[Column, ...]) -> Table:
    return Table("t", "T", "Says something.", columns, rows)


def read(made: Table) -> list[list[str]]:
    return list(csv.reader(io.StringIO(made.csv())))


@given(st.lists(st.tuples(FINITE, st.floats(0, allow_nan=False), TEXTS), min_size=1))
def test_csv_reads_back_every_bit(cells: list[tuple[float, float, str]]) -> None:
    columns = (Column("loss", unit="W"), Column("note"))
    made = table(*((Measured(value, u), note) for value, u, note in cells), columns=columns)
    # newline='' keeps the line breaks inside a text as they are
    header, *lines = csv.reader(io.StringIO(made.csv(), newline=""))
    assert header == ["loss [W]", "u(loss) [W]", "note"]
    assert [(float(value), float(u), note) for value, u, note in lines] == [
        (value, u, spreadsheet_text(note)) for value, u, note in cells
    ]


def test_csv_keeps_numpy_numbers_and_leaves_absent_ones_empty() -> None:
    columns = (Column("n"), Column("x", unit="rpm"), Column("ok"), Column("m"))
    rows: tuple[tuple[Cell, ...], ...] = (
        (np.int64(7), np.float64(0.1), True, 1.5),
        (-2, math.nan, np.False_, Measured(math.nan, math.nan)),
        (None, math.inf, None, Measured(2.0, 0.25)),
    )
    assert read(table(*rows, columns=columns)) == [
        ["n", "x [rpm]", "ok", "m", "u(m)"],
        ["7", "0.1", "true", "1.5", ""],
        ["-2", "", "false", "", ""],
        ["", "inf", "", "2.0", "0.25"],
    ]


def test_line_breaks_of_every_system_come_back_as_line_feeds() -> None:
    made = table(("a\rb\r\nc\nd",), columns=(Column("note"),))
    assert list(csv.reader(io.StringIO(made.csv(), newline="")))[1] == ["a\nb\nc\nd"]


def test_an_empty_table_has_a_header_and_no_mark() -> None:
    empty = table(columns=(Column("x", unit="W", uncertain=True),))
    assert empty.csv() == "x [W]\n"
    assert not empty.marked
    assert empty.numeric == (False,)


@pytest.mark.parametrize(
    ("cell", "unstated"),
    [
        (1.0, True),
        (3, True),
        (Measured(1.0, math.nan), True),
        (Measured(1.0, 0.1), False),
        (None, False),
        (math.nan, False),
        ("absent", False),
    ],
)
def test_a_number_without_uncertainty_is_marked_where_one_is_due(cell: Cell, unstated: bool) -> None:
    assert Column("x", uncertain=True).unstated(cell) is unstated
    assert not Column("x").unstated(cell)


@pytest.mark.parametrize(
    ("column", "cell", "text"),
    [
        (Column("x"), None, "–"),
        (Column("x", digits=1), math.nan, "–"),
        (Column("x", digits=2), -1.0, "−1.00"),
        (Column("x", digits=2), 3, "3.00"),
        (Column("x"), -48, "−48"),
        (Column("x", format="+.1f"), 2.0, "+2.0"),
        (Column("x"), True, "yes"),
        (Column("x"), Measured(3.14159, math.nan), "3.142"),
        (Column("x", digits=1), Measured(3.14159, 0.0123), "3.142 ± 0.012"),
    ],
)
def test_a_cell_is_shown(column: Column, cell: Cell, text: str) -> None:
    assert column.text(cell) == text


def test_only_columns_of_numbers_are_aligned_to_the_right() -> None:
    columns = tuple(Column(name) for name in "abcd")
    made = table(("x", 1.0, True, None), ("y", Measured(1.0, 0.1), False, None), columns=columns)
    assert made.numeric == (False, True, False, False)


def test_a_table_scrolls_from_forty_one_rows() -> None:
    column = (Column("x"),)
    assert not table(*[(1.0,)] * 40, columns=column).long
    assert table(*[(1.0,)] * 41, columns=column).long


def test_a_row_of_the_wrong_length_is_refused() -> None:
    with pytest.raises(ValueError, match="row 1 has 2 cells for 1 columns"):
        table((1.0,), (1.0, 2.0), columns=(Column("x"),))


def test_a_negative_uncertainty_is_refused() -> None:
    with pytest.raises(ValueError, match="zero or more"):
        Measured(1.0, -0.1)
