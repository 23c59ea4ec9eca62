"""Conditions on runs: a small grammar, read into an expression and compiled to SQL with parameters.

::

    condition   = conjunction { "or" conjunction }
    conjunction = term { "and" term }
    term        = "not" term | "(" condition ")" | comparison
    comparison  = COLUMN [ ("=" | "!=" | "<" | "<=" | ">" | ">=") value ]
    value       = NUMBER | TIME | WORD | STRING | "unknown"

A column of yes or no may stand alone. A string stands in single or double quotes; a quote within is doubled.
A time, in UTC, is written as far as it matters: ``2025-04-25``, ``2025-04-25T10:56``.
What is not known meets no comparison but ``= unknown``. No part of the text enters the SQL: columns come from
`COLUMNS`, values are parameters.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from decimal import Decimal
from typing import NoReturn

from pmg.pipeline.catalogue.columns import BY_NAME, OTHER_NAMES, Column, Kind
from pmg.pipeline.catalogue.expression import (
    BARE,
    NUMBER,
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
from pmg.sim.errors import PmgError, near_miss

LONGEST = 4000
"""Characters of a condition."""
DEEPEST = 40
"""Parentheses and ``not`` within one another."""
SLACK = 1e-12
"""Part of a number that rounding in binary may take off a comparison."""
MOMENT = re.compile(
    r"([0-9]{4}(?:-(?:0[1-9]|1[0-2])(?:-(?:0[1-9]|[12][0-9]|3[01]))?)?)"
    r"(?:[T ]((?:[01][0-9]|2[0-3])(?::[0-5][0-9](?::[0-5][0-9](?:\.[0-9]{1,3})?)?)?)Z?)?"
)
"""A time of ISO 8601, cut short where the user likes: the day or a part of it, and the time of that day."""
OTHER_SIGNS = {"==": "=", "<>": "!=", "≠": "!=", "≤": "<=", "≥": ">=", "=<": "<=", "=>": ">="}
"""Signs that people bring from elsewhere, and what is written here."""
FLAGS = {"yes": True, "true": True, "no": False, "false": False}


class QueryError(PmgError):
    """A condition, or the name of a column, that cannot be read."""


@dataclass(frozen=True)
class Token:
    """A piece of a condition: its text, where it begins, and whether it stood in quotes; the end is empty."""

    text: str
    at: int
    quoted: bool = False

    def is_word(self, *words: str) -> bool:
        """Whether it is one of these words or signs, not in quotes."""
        return not self.quoted and self.text.lower() in words


def parse(text: str) -> Condition:
    """The condition that a text states.

    Raises
    ------
    QueryError
        The text is no condition: where, what came, what was expected.
    """
    if len(text) > LONGEST:
        raise QueryError("--where", f"{len(text)} characters", f"at most {LONGEST}", "Ask in several steps.")
    return _Reader(_tokens(text)).whole()


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


def compiled(condition: Condition) -> tuple[str, list[str | float]]:
    """The condition as SQL on the view ``runs``, and its parameters."""
    if isinstance(condition, Comparison):
        return _comparison(condition)
    if isinstance(condition, Not):
        inner, values = compiled(condition.part)
        return f"(NOT {inner})", values
    pieces, parameters = [], []
    for part in condition.parts:
        piece, values = compiled(part)
        pieces.append(piece)
        parameters += values
    return "(" + f" {condition.word.upper()} ".join(pieces) + ")", parameters


def _comparison(said: Comparison) -> tuple[str, list[str | float]]:
    name, sign, value = said.column.name, said.sign, said.value
    if isinstance(value, Unknown):
        return f"({name} IS {'NOT ' * (sign == '!=')}NULL)", []
    if isinstance(value, Number) and sign in ("=", "!="):
        near = "<=" if sign == "=" else ">"
        number = float(value.text)
        half = half_last_digit(value.text) + SLACK * abs(number)
        return f"({name} IS NOT NULL AND ABS({name} - ?) {near} ?)", [number, half]
    shown: str | float
    if isinstance(value, Number):
        shown = float(value.text)
    elif isinstance(value, Flag):
        shown = float(value.on)
    elif said.column.kind is Kind.TIME:
        return f"({name} IS NOT NULL AND SUBSTR({name}, 1, ?) {sign} ?)", [float(len(value.text)), value.text]
    else:
        shown = value.text
    return f"({name} IS NOT NULL AND {name} {sign} ?)", [shown]


def half_last_digit(text: str) -> float:
    """Half of the last digit of a number as it is written: 0.005 for ``1.56``, 0.5 for ``1000`` and for ``1e3``."""
    exponent = Decimal(text).as_tuple().exponent
    return float(f"5e{min(int(exponent), 0) - 1}")


def _tokens(text: str) -> list[Token]:
    found, at = [], 0
    while at < len(text):
        sign = next((sign for sign in (*SIGNS, "(", ")") if text.startswith(sign, at)), None)
        if text[at].isspace():
            at += 1
        elif sign is not None:
            found.append(Token(sign, at))
            at += len(sign)
        elif text[at] in "\"'":
            token, at = _string(text, at)
            found.append(token)
        elif word := BARE.match(text, at):
            found.append(_encodable(Token(word.group(), at)))
            at = word.end()
        else:
            _refuse(Token(text[at], at), "a column, a sign or a value", "Unequal is written !=.")
    return [*found, Token("", len(text))]


def _string(text: str, begin: int) -> tuple[Token, int]:
    """The string that begins there, and where it has ended."""
    mark, at = text[begin], begin + 1
    while (end := text.find(mark, at)) >= 0:
        if not text.startswith(mark, end + 1):
            inner = text[begin + 1 : end].replace(mark * 2, mark)
            return _encodable(Token(inner, begin, quoted=True)), end + 1
        at = end + 2
    return _refuse(Token(text[begin : begin + 20], begin), f"a closing {mark}", "Close the string.")


def _encodable(token: Token) -> Token:
    try:
        token.text.encode()
    except UnicodeEncodeError:
        _refuse(token, "text in UTF-8", "Write it anew.")
    return token


def _refuse(token: Token, expected: str, do: str) -> NoReturn:
    came = repr(token.text) if token.text or token.quoted else "the end"
    raise QueryError(f"--where, character {token.at + 1}", came, expected, do)


class _Reader:
    """The tokens of a condition, read from left to right."""

    def __init__(self, tokens: list[Token]) -> None:
        self.tokens, self.at = tokens, 0

    @property
    def next(self) -> Token:
        return self.tokens[self.at]

    def take(self) -> Token:
        self.at += 1
        return self.tokens[self.at - 1]

    @property
    def ended(self) -> bool:
        return self.at == len(self.tokens) - 1

    def whole(self) -> Condition:
        condition = self.joined(0)
        if not self.ended:
            after = "Units are part of the names of columns, as in sun_rpm; text with blanks stands in quotes."
            _refuse(self.next, "and, or, or the end", after)
        return condition

    def joined(self, depth: int, word: str = "or") -> Condition:
        def part() -> Condition:
            return self.joined(depth, "and") if word == "or" else self.term(depth)

        parts = [part()]
        while self.next.is_word(word):
            self.take()
            parts.append(part())
        return parts[0] if len(parts) == 1 else Joined(word, tuple(parts))

    def term(self, depth: int) -> Condition:
        if depth > DEEPEST:
            _refuse(self.next, f"at most {DEEPEST} parentheses within one another", "Ask in several steps.")
        if self.next.is_word("not"):
            self.take()
            return Not(self.term(depth + 1))
        if not self.next.is_word("("):
            return self.comparison()
        self.take()
        condition = self.joined(depth + 1)
        if not self.next.is_word(")"):
            _refuse(self.next, "and, or, or a closing )", "Close the parenthesis.")
        self.take()
        return condition

    def comparison(self) -> Comparison:
        token = self.take()
        is_name = BARE.fullmatch(token.text) and not token.quoted
        if not is_name or NUMBER.fullmatch(token.text) or token.is_word("and", "or", "unknown"):
            _refuse(token, "the name of a column", "Begin with a column, as in sun_rpm > 1000.")
        column = column_named(token.text, f"--where, character {token.at + 1}")
        if not self.next.is_word(*SIGNS):
            if column.kind is Kind.FLAG:
                return Comparison(column, "=", Flag(on=True))
            meant = OTHER_SIGNS.get(self.next.text[:1])
            after = "Say what it is compared with." if meant is None else f"It is written {meant} here."
            _refuse(self.next, f"one of {' '.join(SIGNS)} after {column.name}", after)
        sign, value = self.take(), self.take()
        if not value.quoted and (not value.text or value.text in (*SIGNS, "(", ")")):
            meant = OTHER_SIGNS.get(sign.text + value.text)
            after = "Text with signs or blanks stands in quotes." if meant is None else f"It is written {meant} here."
            _refuse(value, f"a value for {column.name}", after)
        return Comparison(column, sign.text, _value(column, sign, value))


def _value(column: Column, sign: Token, token: Token) -> Number | Text | Flag | Unknown:
    unordered = sign.text in ("=", "!=")
    if token.is_word("unknown"):
        if not unordered:
            _refuse(sign, "= or != before unknown", "What is not known has no order.")
        return Unknown()
    if column.kind is Kind.NUMBER:
        if not NUMBER.fullmatch(token.text) or not math.isfinite(float(token.text)):
            unit = f" in {column.unit}" if column.unit else ""
            _refuse(token, f"a number{unit} for {column.name}", "Give a number without its unit, such as 1.56.")
        return Number(token.text)
    if column.kind is Kind.FLAG:
        if not unordered:
            _refuse(sign, f"= or != after {column.name}", "It is yes or no.")
        if token.text.lower() not in FLAGS:
            _refuse(token, f"yes or no for {column.name}", near_miss(token.text, ("yes", "no")))
        return Flag(FLAGS[token.text.lower()])
    if column.kind is Kind.TIME:
        found = MOMENT.fullmatch(token.text)
        if found is None or (found[2] is not None and len(found[1]) < len("2025-04-25")):
            _refuse(token, f"a time in UTC for {column.name}", "Such as 2025-04-25 or 2025-04-25T10:56.")
        return Text(found[1] if found[2] is None else f"{found[1]}T{found[2]}")
    return Text(token.text)
