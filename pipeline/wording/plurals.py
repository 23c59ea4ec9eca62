"""Numbers next to the nouns that they count, lists cut short, and the beginning of a sentence."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence


NAMED = 5
"""Files or points that a message names one by one."""


def listed(names: Sequence[str]) -> str:
    """The first `NAMED` names, with ``...`` where there are more."""
    return ", ".join(names[:NAMED]) + (" ..." if len(names) > NAMED else "")


def counted(number: int, noun: str) -> str:
    """A number and what it counts: ``1 row``, ``2 rows``; the plural ends in s."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def capitalised(words: str) -> str:
    """Words as the beginning of a sentence; the case of all other letters stays."""
    return f"{words[:1].upper()}{words[1:]}"


def uncapitalised(words: str) -> str:
    """Words as they stand within a sentence; the case of all other letters stays."""
    return f"{words[:1].lower()}{words[1:]}"
