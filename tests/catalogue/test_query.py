"""Conditions in SQL: they choose rows, cannot do more than read, and a fault is stated in four parts."""

from __future__ import annotations

import sqlite3
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pmg.pipeline.catalogue.columns import COLUMNS
from pmg.pipeline.catalogue.query import LONGEST, SECONDS, QueryError, select, texts_asked_for

if TYPE_CHECKING:
    from collections.abc import Iterator

CELLS = {
    "sun_rpm": 1200.0,
    "load": 1.56,
    "accepted": 0,
    "drive": "sun",
    "gear": 1,
    "reasons": "",
    "start": "2025-04-23T08:01:00.250+00:00",
    "point": "E_b 'x'",
}


def catalogue(count: int = 1, **cells: object) -> sqlite3.Connection:
    """Some equal rows of the view ``runs``."""
    connection = sqlite3.connect(":memory:")
    names = ", ".join(column.name for column in COLUMNS)
    connection.execute(f"CREATE TABLE Given ({names})")
    row = [(CELLS | cells).get(column.name) for column in COLUMNS]
    connection.executemany(f"INSERT INTO Given VALUES ({', '.join('?' * len(row))})", [row] * count)
    connection.execute("CREATE VIEW runs AS SELECT * FROM Given")
    connection.commit()
    return connection


def found(connection: sqlite3.Connection, condition: str | None, seconds: float = SECONDS) -> int:
    return len(select(connection, COLUMNS[:3], condition, "start", ("Given", "runs"), seconds))


@pytest.fixture
def one() -> Iterator[sqlite3.Connection]:
    connection = catalogue()
    yield connection
    connection.close()


@pytest.mark.parametrize(
    ("text", "met"),
    [
        ("sun_rpm > 1000 and load = 1.56", True),
        ("speed_sun_rpm > 1000", True),
        ("SUN_RPM > 1000 AND NOT accepted", True),
        ("sun_rpm < 1000 or round(load, 1) = 1.6", True),
        ("sun_rpm < 1000 or round(load, 2) = 1.6", False),
        ("load between 1.5 and 1.6", True),
        ("accepted = false and not (drive = 'ring' or gear != 1)", True),
        ("accepted", False),
        ("start like '2025-04-23%'", True),
        ("start <= '2025-04-23T09'", True),
        ("start > '2025-04-23T08:01:01'", False),
        ("date(start) = '2025-04-23'", True),
        ("point = 'E_b ''x'''", True),
        ("point in ('a', 'E_b ''x''')", True),
        ("seconds is null", True),
        ("seconds > 0 or seconds <= 0 or seconds != 1", False),
        ("reasons = ''", True),
        ("load >= (select max(load) from runs)", True),
        ("accepted -- a remark", False),
    ],
)
def test_conditions_on_a_row(one: sqlite3.Connection, text: str, met: bool) -> None:
    assert found(one, text) == int(met)


fifteen_digits = st.integers(-(10**15) + 1, 10**15 - 1).map(lambda digits: digits / 1e11)
"""SQLite reads fifteen digits of a number as they are written."""


@given(fifteen_digits, fifteen_digits)
def test_numbers_are_compared_as_numbers(value: float, asked: float) -> None:
    connection = catalogue(load=value)
    assert found(connection, f"load > {asked!r}") == (value > asked)
    assert found(connection, f"load = {asked!r}") == (value == asked)
    connection.close()


@pytest.mark.parametrize(
    ("text", "came", "hint"),
    [
        ("load = 1 and sun_rmp > 3", "'sun_rmp'", "Did you mean 'sun_rpm'?"),
        ("point = E_a", "'E_a'", "'E_a'"),
        ("status = failed", "'failed'", "single quotes: 'failed'"),
        ("accepted = no", "'no'", "FALSE"),
        ("accepted = yes", "'yes'", "TRUE"),
        ("load = unknown", "'unknown'", "IS NULL"),
        ("sun_rpm > 1000 rpm", "rpm", "units are part of the names"),
        ("sun_rpm >", ")", "Such as"),
        ("sun_rpm ≥ 3", "≥", "Such as"),
        ("(accepted", "", "Such as"),
        ("accepted)", ")", "Such as"),
        ("point = 'x", "'x", "Such as"),
        ('point = "x"', "double quote", "'E_a'"),
        ("", "nothing", "Such as"),
        ("point = ?", "binding", "Such as"),
        ("start > 2025-04-23", "2025-04-23", "'2025-04-23'"),
        ("start = 2025-04-23T08:01", "2025-04-23T08:01", "LIKE '2025-04-23T08:01%'"),
        ("accepted or " * 1000, "characters", "several steps"),
        ("(" * 300 + "accepted" + ")" * 300, "", "Such as"),
        ("accepted \0", "", "Such as"),
    ],
)
def test_a_fault_says_what_came_and_what_to_do(one: sqlite3.Connection, text: str, came: str, hint: str) -> None:
    with pytest.raises(QueryError) as caught:
        found(one, text)
    assert caught.value.where == "--where"
    assert came in caught.value.came
    assert hint in caught.value.do
    assert caught.value.expected


@pytest.mark.parametrize(
    "text",
    [
        "1); DROP TABLE Given; --",
        "exists (select 1 from sqlite_master)",
        "exists (select 1 from pragma_table_info('Given'))",
        "load_extension('x') is null",
        "length(randomblob(100000000)) > 0",
        "exists (select 1 from json_each('[1]'))",
        "1 in (with recursive n(x) as (select 1 union all select x + 1 from n) select x from n)",
        "printf('%1000000d', 1) is not null",
    ],
)
def test_a_condition_can_do_no_more_than_read_the_runs(one: sqlite3.Connection, text: str) -> None:
    with pytest.raises(QueryError):
        found(one, text)
    assert found(one, None) == 1
    with pytest.raises(sqlite3.OperationalError, match="readonly"):
        one.execute("DELETE FROM Given")


def test_a_condition_that_takes_too_long_is_ended() -> None:
    connection = catalogue(2000)
    slow = "(select count(*) from runs a, runs b where a.load + b.load > 0) > 0"
    with pytest.raises(QueryError, match="not done after 0 s"):
        found(connection, slow, seconds=0.0)
    assert found(connection, "load > 1") == 2000
    connection.close()


@given(
    st.text(max_size=60) | st.text(st.sampled_from("sun_rpm load point ()=<>!'\";-- and or not 1.5\\%"), max_size=60)
)
def test_any_text_is_a_condition_or_refused(text: str) -> None:
    connection = catalogue()
    before, told = connection.total_changes, None
    try:
        assert found(connection, text) in (0, 1)
    except QueryError as error:
        told = error
    assert told is None or (told.where == "--where" and told.expected and told.do)
    assert connection.total_changes == before
    assert found(connection, None) == 1
    connection.close()


def test_a_condition_may_be_as_long_as_it_says(one: sqlite3.Connection) -> None:
    text = "not accepted"
    assert found(one, text.ljust(LONGEST)) == 1


def test_words_asked_for_are_found_with_their_columns() -> None:
    asked = texts_asked_for("configuration = 'engagd' and point='it''s' and load = 1 and start = '2025' and x = 'y'")
    assert [(column.name, text) for column, text in asked] == [("configuration", "engagd"), ("point", "it's")]
