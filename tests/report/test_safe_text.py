"""No text of a recording can act: not on a terminal, not in a page, not in a spreadsheet."""

from __future__ import annotations

import csv
import io
import json
import unicodedata

import polars as pl
from hypothesis import given
from hypothesis import strategies as st

from pmg.pipeline.report.document import Column, Table
from pmg.pipeline.wording.safe_text import printable, printable_json, printable_lines, spreadsheet_text
from pmg.pipeline.wording.spreadsheet import spreadsheet_csv

HOSTILE = ("\x1b]0;owned\x07", "\x9b31m", "a\u202eb", "\x00", "\u2066x\u2069", "\x7f")


def steers(text: str) -> bool:
    return any(unicodedata.category(sign) in ("Cc", "Cf", "Cs", "Zl", "Zp") for sign in text)


@given(st.text(st.characters()))
def test_nothing_printable_steers(text: str) -> None:
    assert not steers(printable(text))
    assert not steers(printable_lines(text).replace("\n", "").replace("\t", ""))
    if text.isprintable():
        assert printable(text) == text


def test_words_of_other_languages_and_units_stay() -> None:
    for text in ("Drehmoment für Ωring, 3,7 mN m ± 0,1", "温度", "12\u00a0%"):
        assert printable(text) == text


@given(st.dictionaries(st.text(), st.text() | st.floats(allow_nan=False, allow_infinity=False)))
def test_a_json_document_reads_back_as_it_was(values: dict[str, object]) -> None:
    document = json.dumps(values, ensure_ascii=False, indent=1)
    assert json.loads(printable_json(document)) == values
    assert not steers(printable_json(document).replace("\n", ""))


@given(st.text(min_size=1))
def test_no_text_cell_begins_a_formula(text: str) -> None:
    safe = spreadsheet_text(text)
    assert safe in (text, f"'{text}")
    if safe.startswith(("=", "@", "\t", "\r")):
        raise AssertionError(safe)
    if safe.startswith(("+", "-")):
        float(safe)


def test_numbers_stay_numbers() -> None:
    assert [spreadsheet_text(text) for text in ("-3.5", "+1e3", "-inf", "=1+1", "-cmd|x")] == [
        "-3.5",
        "+1e3",
        "-inf",
        "'=1+1",
        "'-cmd|x",
    ]


def test_tables_of_every_kind_are_safe() -> None:
    hostile = '=HYPERLINK("http://x","y")'
    table = Table("t", "Table", "Texts.", (Column("point", "Point"), Column("torque", "Torque")), ((hostile, -0.5),))
    frame = pl.DataFrame({"point": [hostile, None], "torque": [-0.5, 1.0]})
    for text in (table.csv(), spreadsheet_csv(frame)):
        rows = list(csv.reader(io.StringIO(text)))
        assert rows[1] == [f"'{hostile}", "-0.5"]
