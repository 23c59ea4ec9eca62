"""Tables of a TOML file as pydantic models: known keys, units in the keys, no silent conversion."""

from __future__ import annotations

import re
from contextlib import contextmanager
from typing import TYPE_CHECKING, NoReturn

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict

from pmg.sim.errors import PmgError, near_miss

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator

MOST_NAMED = 5
"""Most words that a message names as expected; more are left to its hint."""


class RefusalError(ValueError):
    """A value that is refused, in the parts of a `PmgError`; `key` leads from the check to what is wrong."""

    def __init__(self, came: str, expected: str, do: str, key: tuple[str | int, ...]) -> None:
        self.came, self.expected, self.do, self.key = came, expected, do, key
        super().__init__(came, expected, do)


def refuse(came: str, expected: str, do: str, *key: str | int) -> NoReturn:
    """Refuse a value; `key` leads from where the check stands to what is wrong."""
    raise RefusalError(came, expected, do, key)


@contextmanager
def refusing(*key: str | int) -> Iterator[None]:
    """Make an error or a refusal of a check one of the value at `key`, from where the check stood."""
    try:
        yield
    except (PmgError, RefusalError) as problem:
        refuse(problem.came, problem.expected, problem.do, *key, *getattr(problem, "key", ()))


def refuse_unknown(given: Iterable[str], known: Collection[str], expected: str = "a known one") -> None:
    """Refuse the first key of a table that is not known."""
    for name in given:
        if name not in known:
            refuse("unknown key", expected, near_miss(name, known), name)


def refuse_twice(names: Iterable[str], *key: str) -> None:
    """Refuse a name that comes a second time in a list of tables; `key` leads to the list, and within a table."""
    seen: set[str] = set()
    for i, name in enumerate(names):
        if name in seen:
            refuse(f"'{name}' twice", "each once", "Leave one of them out.", *key[:1], i, *key[1:])
        seen.add(name)


def number_within(value: object, low: float, high: float, unit: str = "") -> float:
    """A number that lies in a range, both ends included.

    Raises
    ------
    RefusalError
        It is none, or lies outside.
    """
    of_unit = f" {unit}" if unit not in ("", "1") else ""
    if isinstance(value, bool) or not isinstance(value, int | float):
        refuse(repr(value), f"a number from {low:g} to {high:g}{of_unit}", "Correct the value.")
    if not low <= value <= high:
        refuse(f"{value:g}{of_unit}", f"{low:g} to {high:g}{of_unit}", "Choose a value in that range.")
    return value


def within(low: float, high: float, unit: str = "") -> BeforeValidator:
    """A check that a number lies in a range, both ends included."""
    return BeforeValidator(lambda value: number_within(value, low, high, unit))


def key_of(name: str) -> str:
    """Key of a field in the file: its unit is spelled as it should be."""
    return re.sub("_nm$", "_Nm", re.sub("_hz$", "_Hz", name))


def word_of(value: object, words: Collection[str], *key: str | int) -> str:
    """A word that is one of these; `key` leads to it.

    Raises
    ------
    RefusalError
        It is not.
    """
    if not isinstance(value, str) or value not in words:
        expected = " or ".join(f'"{word}"' for word in words) if len(words) <= MOST_NAMED else "a known word"
        refuse(repr(value), expected, near_miss(str(value), words), *key)
    return value


def one_of(*members: str) -> BeforeValidator:
    """A check that a word of the file is one of these, or names one of these members of an enumeration."""
    words = {str(member): member for member in members}
    return BeforeValidator(lambda value: words[word_of(value, words)])


def _each_once(values: list[str]) -> list[str]:
    if len(set(values)) < len(values):
        refuse(repr(values), "each once", "Leave one of them out.")
    return values


EACH_ONCE = AfterValidator(_each_once)
"""A check that a list holds each of its entries once."""


class Strict(BaseModel):
    """A table of the file: known keys, no silent conversion."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, alias_generator=key_of)
