"""Conditions on runs: a WHERE clause, worked out by SQLite on a copy of the catalogue that it may only read."""

from __future__ import annotations

import re
import sqlite3
import time
from typing import TYPE_CHECKING

from pmg.pipeline.catalogue.columns import BY_NAME, OTHER_NAMES, Column, Kind
from pmg.sim.errors import PmgError, closest, near_miss

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from pmg.pipeline.catalogue.entries import Cell

LONGEST = 4000
"""Characters of a condition."""
SECONDS = 5.0
"""Longest time that a condition may take [s]."""
STEPS = 1000
"""Instructions of SQLite between two looks at the clock."""
LIMITS = {
    sqlite3.SQLITE_LIMIT_LENGTH: 10_000_000,
    sqlite3.SQLITE_LIMIT_EXPR_DEPTH: 200,
    sqlite3.SQLITE_LIMIT_LIKE_PATTERN_LENGTH: 200,
}
"""Bounds on what a single function may do, as the clock is looked at between functions."""
FUNCTIONS = (
    *("abs", "avg", "coalesce", "count", "date", "datetime", "glob", "ifnull", "iif", "instr", "julianday", "length"),
    *("like", "lower", "ltrim", "max", "min", "nullif", "replace", "round", "rtrim", "strftime", "substr", "substring"),
    *("sum", "time", "total", "trim", "upper"),
)
"""Functions that a condition may call."""
ALLOWED = {sqlite3.SQLITE_SELECT, sqlite3.SQLITE_READ, sqlite3.SQLITE_FUNCTION}

STRING = re.compile(r"'(?:[^']|'')*'")
BARE_TIME = re.compile(r"\b[0-9]{4}-[0-9]{2}\b[-0-9T:.Z]*")
"""A time outside a string, which SQL takes for a subtraction."""
EQUALS_TEXT = re.compile(r"\b(\w+)\s*==?\s*'((?:[^']|'')*)'")
OTHER_WORDS = {"yes": "Write TRUE.", "no": "Write FALSE.", "unknown": "Write IS NULL."}
"""Words that are none of SQL, and what is written instead."""
EXAMPLE = "Such as \"sun_rpm > 1000 and point = 'E_a'\"; units are part of the names of columns."


class QueryError(PmgError):
    """A condition, or the name of a column, that cannot be read."""


def column_named(word: str, where: str) -> Column:
    """The column of that name.

    Raises
    ------
    QueryError
        There is none; the nearest is named.
    """
    column = BY_NAME.get(OTHER_NAMES.get(word, word))
    if column is None:
        raise QueryError(where, repr(word), "the name of a column", near_miss(word, {*BY_NAME, *OTHER_NAMES}))
    return column


def select(
    connection: sqlite3.Connection,
    columns: Sequence[Column],
    condition: str | None,
    order: str,
    tables: Collection[str],
    seconds: float = SECONDS,
) -> list[tuple[Cell, ...]]:
    """Rows of the view ``runs`` that meet a condition.

    Parameters
    ----------
    connection : sqlite3.Connection
        To a catalogue in memory.
    columns : sequence of Column
        What is given of each row.
    condition : str, optional
        A WHERE clause by the user; all rows without one.
    order : str
        An ORDER BY clause of our own.
    tables : collection of str
        Tables and views that may be read.
    seconds : float
        Longest time that it may take [s].

    Raises
    ------
    QueryError
        The condition is none, calls for more than reading, or takes too long.
    """
    if condition is not None:
        _refuse_what_sql_takes_otherwise(condition)
    others = ", ".join(f"{name} AS {other}" for other, name in OTHER_NAMES.items())
    names = ", ".join(column.name for column in columns)
    where = "1" if condition is None else condition
    text = f"SELECT {names} FROM (SELECT *, {others} FROM runs) WHERE (\n{where}\n) ORDER BY {order}"

    def _may(action: int, one: str | None, two: str | None, *_: str | None) -> int:
        allowed = action in ALLOWED
        if action == sqlite3.SQLITE_READ:
            allowed = one in tables
        elif action == sqlite3.SQLITE_FUNCTION:
            allowed = (two or "").lower() in FUNCTIONS
        return sqlite3.SQLITE_OK if allowed else sqlite3.SQLITE_DENY

    end = time.monotonic() + seconds
    connection.execute("PRAGMA query_only = ON")
    for category, most in LIMITS.items():
        connection.setlimit(category, most)
    connection.set_authorizer(_may)
    connection.set_progress_handler(lambda: time.monotonic() >= end, STEPS)
    try:
        return connection.execute(text).fetchall()
    except (sqlite3.Error, sqlite3.Warning, ValueError) as fault:
        raise _clear_error(fault, seconds) from fault
    finally:
        connection.set_authorizer(None)
        connection.set_progress_handler(None, 0)


def _refuse_what_sql_takes_otherwise(condition: str) -> None:
    """Refuse what SQLite would take for something else than was meant."""
    if len(condition) > LONGEST:
        raise QueryError("--where", f"{len(condition)} characters", f"at most {LONGEST}", "Ask in several steps.")
    if not condition.strip():
        raise QueryError("--where", "nothing", "a condition in SQL", EXAMPLE)
    outside = STRING.sub("''", condition)
    if '"' in outside:
        raise QueryError("--where", "a double quote", "text in single quotes", "Write 'E_a'.")
    if found := BARE_TIME.search(outside):
        do = f"Write '{found[0]}', or LIKE '{found[0]}%' for all that begins so."
        raise QueryError("--where", found[0], "a time in single quotes", do)


def _clear_error(fault: Exception, seconds: float) -> QueryError:
    """Message of SQLite, in four parts."""
    code, said = getattr(fault, "sqlite_errorname", ""), str(fault)
    if code == "SQLITE_INTERRUPT":
        return QueryError("--where", f"not done after {seconds:g} s", "a quicker condition", "Ask in several steps.")
    if code == "SQLITE_AUTH":
        expected = f"columns, values, and of functions {', '.join(FUNCTIONS)}"
        return QueryError("--where", said, expected, "A condition may read the view runs, and nothing else.")
    unknown = said.removeprefix("no such column: ")
    if unknown != said:
        hint = closest(unknown, {*BY_NAME, *OTHER_NAMES}) or "'--columns all' shows all columns."
        do = OTHER_WORDS.get(unknown.lower()) or f"{hint} Text stands in single quotes: '{unknown}'."
        return QueryError("--where", f"'{unknown}'", "the name of a column", do)
    return QueryError("--where", said, "a condition in SQL", EXAMPLE)


def texts_asked_for(condition: str) -> list[tuple[Column, str]]:
    """Columns of text, and the words that a condition sets them equal to."""
    named = ((BY_NAME.get(OTHER_NAMES.get(name, name)), text) for name, text in EQUALS_TEXT.findall(condition))
    return [(column, text.replace("''", "'")) for column, text in named if column and column.kind is Kind.TEXT]
