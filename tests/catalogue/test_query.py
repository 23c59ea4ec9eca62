"""The grammar of conditions: what is written out reads the same, and no text becomes SQL."""

from __future__ import annotations

import re
import sqlite3

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pmg.pipeline.catalogue.columns import COLUMNS, Kind
from pmg.pipeline.catalogue.expression import (
    SIGNS,
    Comparison,
    Condition,
    Flag,
    Joined,
    Not,
    Number,
    Text,
    Unknown,
)
from pmg.pipeline.catalogue.query import QueryError, compiled, half_last_digit, parse

NUMBERS = st.from_regex(r"\A[+-]?[0-9]{1,5}(\.[0-9]{0,4})?(e[+-]?[0-9])?\Z").map(Number)
TIMES = st.sampled_from(("2025", "2025-04", "2025-04-23", "2025-04-23T08", "2025-04-23T08:01:00.250")).map(Text)
WORDS = st.text(st.characters(exclude_categories=["Cs"]), max_size=12).map(Text)


@st.composite
def comparisons(draw: st.DrawFn) -> Comparison:
    column = draw(st.sampled_from(COLUMNS))
    if draw(st.integers(0, 5)) == 0:
        return Comparison(column, draw(st.sampled_from(("=", "!="))), Unknown())
    if column.kind is Kind.FLAG:
        return Comparison(column, draw(st.sampled_from(("=", "!="))), Flag(draw(st.booleans())))
    words = TIMES if column.kind is Kind.TIME else WORDS
    value: Number | Text = draw(NUMBERS) if column.kind is Kind.NUMBER else draw(words)
    return Comparison(column, draw(st.sampled_from(SIGNS)), value)


CONDITIONS: st.SearchStrategy[Condition] = st.recursive(
    comparisons(),
    lambda inner: st.one_of(
        inner.map(Not),
        st.tuples(st.sampled_from(("and", "or")), st.lists(inner, min_size=2, max_size=4).map(tuple)).map(
            lambda of: Joined(*of)
        ),
    ),
    max_leaves=8,
)


@given(CONDITIONS)
def test_what_is_written_out_reads_the_same(condition: Condition) -> None:
    assert parse(str(condition)) == condition


NAMES = sorted((column.name for column in COLUMNS), key=len, reverse=True)
WORDS_OF_SQL = ("IS NOT NULL", "IS NULL", "AND", "OR", "NOT", "ABS", "SUBSTR", "1", "?", ",", "-")
ALLOWED = re.compile(rf"(?:{'|'.join(map(re.escape, (*NAMES, *WORDS_OF_SQL)))}|[()<>=! ])*")


@given(CONDITIONS)
def test_sql_holds_names_of_columns_and_marks_only(condition: Condition) -> None:
    sql, parameters = compiled(condition)
    assert ALLOWED.fullmatch(sql)
    assert sql.count("?") == len(parameters)


@given(
    st.text(max_size=60) | st.text(st.sampled_from("sun_rpm load point ()=<>!'\";-- and or not 1.5\\%"), max_size=60)
)
def test_any_text_is_a_condition_or_told_with_its_place(text: str) -> None:
    told = None
    try:
        sql, parameters = compiled(parse(text))
    except QueryError as error:
        told = error
    if told is None:
        assert ALLOWED.fullmatch(sql)
        assert all(isinstance(value, float | str) for value in parameters)
    else:
        assert told.where.startswith("--where")
        assert told.expected


def answer(text: str, **row: object) -> bool:
    """Whether one row with these values meets a condition."""
    connection = sqlite3.connect(":memory:")
    columns = ", ".join(f"? AS {column.name}" for column in COLUMNS)
    sql, parameters = compiled(parse(text))
    values = [row.get(column.name) for column in COLUMNS]
    found = connection.execute(f"SELECT 1 FROM (SELECT {columns}) WHERE {sql}", [*values, *parameters])
    met = bool(found.fetchall())
    connection.close()
    return met


@given(st.floats(-2e4, 2e4), st.decimals(-20_000, 20_000, places=2))
def test_equal_means_within_half_the_last_digit_written(value: float, asked: object) -> None:
    text = f"{asked}"
    near = abs(value - float(text)) <= 0.005 + 1e-12 * abs(float(text))
    assert answer(f"load = {text}", load=value) is near
    assert answer(f"load != {text}", load=value) is not near


@pytest.mark.parametrize(("text", "half"), [("1.56", 0.005), ("1000", 0.5), ("-2.", 0.5), (".50", 0.005), ("1e3", 0.5)])
def test_half_of_the_last_digit(text: str, half: float) -> None:
    assert half_last_digit(text) == pytest.approx(half)


@pytest.mark.parametrize(
    ("text", "met"),
    [
        ("sun_rpm > 1000 and load = 1.56", True),
        ("speed_sun_rpm > 1000", True),
        ("sun_rpm < 1000 or load = 1.6", True),
        ("sun_rpm < 1000 or load = 1.60", False),
        ("not sun_rpm < 1000 and not accepted", True),
        ("accepted = no and not (drive = ring or gear != 1)", True),
        ("accepted", False),
        ("start = 2025-04-23", True),
        ("start <= 2025-04-23T08", True),
        ("start = '2025-04-23 08:01'", True),
        ("start > '2025-04-23 09:00Z'", False),
        ("start > 2025-04-23T08:01", False),
        ("point = \"E_b 'x'\"", True),
        ("point = 'E_b ''x'''", True),
        ("seconds = unknown", True),
        ("seconds > 0 or seconds <= 0 or seconds != 1", False),
        ("seconds != unknown", False),
        ("reasons = ''", True),
    ],
)
def test_conditions_on_a_row(text: str, met: bool) -> None:
    row = {"sun_rpm": 1200.0, "load": 1.5621, "accepted": 0, "drive": "sun", "gear": 1, "reasons": ""}
    assert answer(text, **row, start="2025-04-23T08:01:00.250+00:00", point="E_b 'x'") is met


@pytest.mark.parametrize(
    ("text", "place", "came", "hint"),
    [
        ("load = 1 and sun_rmp > 3", 14, "sun_rmp", "sun_rpm"),
        ("sun_rpm > fast", 11, "fast", "number"),
        ("sun_rpm > 1000 rpm", 16, "rpm", "Units"),
        ("sun_rpm", 8, "the end", "compared"),
        ("sun_rpm >", 10, "the end", ""),
        ("sun_rpm == 3", 10, "=", "written = here"),
        ("sun_rpm ≥ 3", 9, "≥", "written >= here"),
        ("(accepted", 10, "the end", "parenthesis"),
        ("accepted)", 9, ")", ""),
        ("1000 < sun_rpm", 1, "1000", "Begin"),
        ("point = 'x", 9, "'x", "Close"),
        ("accepted = maybe", 12, "maybe", ""),
        ("accepted > no", 10, ">", "yes or no"),
        ("sun_rpm > unknown", 9, ">", "order"),
        ("", 1, "the end", "Begin"),
        ("point = x; DROP TABLE runs", 12, "DROP", ""),
        ("load = 1e999", 8, "1e999", "number"),
        ("start > banana", 9, "banana", "time"),
        ("start > 2025-13", 9, "2025-13", "time"),
        ("start = 2025T10", 9, "2025T10", "time"),
        ("(" * 60 + "accepted" + ")" * 60, 42, "(", ""),
        ("not " * 60 + "accepted", 165, "not", ""),
    ],
)
def test_an_error_says_where_and_what(text: str, place: int, came: str, hint: str) -> None:
    with pytest.raises(QueryError) as caught:
        parse(text)
    assert caught.value.where == f"--where, character {place}"
    assert came in caught.value.came
    assert hint in str(caught.value)


def test_a_condition_without_end_is_refused() -> None:
    with pytest.raises(QueryError, match="characters"):
        parse("accepted or " * 1000)
