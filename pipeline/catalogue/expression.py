"""What a condition on runs consists of, and how it is written out again."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from pmg.pipeline.catalogue.columns import Column

KEYWORDS = frozenset({"and", "or", "not", "unknown"})
"""Words with a meaning of their own; in quotes they are text."""
SIGNS = ("<=", ">=", "!=", "=", "<", ">")
BARE = re.compile(r"""[^\s()=!<>"']+""")
"""A word that needs no quotes."""
NUMBER = re.compile(r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?")


@dataclass(frozen=True)
class Number:
    """A number as it was written, as its last digit says how closely ``=`` compares."""

    text: str

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class Text:
    """A word or a string."""

    text: str

    def __str__(self) -> str:
        plain = BARE.fullmatch(self.text) and self.text.lower() not in KEYWORDS
        return self.text if plain else '"' + self.text.replace('"', '""') + '"'


@dataclass(frozen=True)
class Flag:
    """Yes or no."""

    on: bool

    def __str__(self) -> str:
        return "yes" if self.on else "no"


@dataclass(frozen=True)
class Unknown:
    """What is not known."""

    def __str__(self) -> str:
        return "unknown"


@dataclass(frozen=True)
class Comparison:
    """A column, one of `SIGNS`, and what it is compared with."""

    column: Column
    sign: str
    value: Number | Text | Flag | Unknown

    def __str__(self) -> str:
        return f"{self.column.name} {self.sign} {self.value}"


@dataclass(frozen=True)
class Not:
    """The opposite."""

    part: Condition

    def __str__(self) -> str:
        return f"not {_inner(self.part)}"


@dataclass(frozen=True)
class Joined:
    """Two conditions or more, joined by ``and`` or by ``or``."""

    word: str
    parts: tuple[Condition, ...]

    def __str__(self) -> str:
        return f" {self.word} ".join(map(_inner, self.parts))


Condition: TypeAlias = Comparison | Not | Joined


def _inner(condition: Condition) -> str:
    return f"({condition})" if isinstance(condition, Joined) else str(condition)


def comparisons(condition: Condition) -> tuple[Comparison, ...]:
    """Every comparison of a condition, in order."""
    if isinstance(condition, Comparison):
        return (condition,)
    parts = (condition.part,) if isinstance(condition, Not) else condition.parts
    return tuple(found for part in parts for found in comparisons(part))
