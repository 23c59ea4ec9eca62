"""Numbers beside the nouns that they count."""

from __future__ import annotations


def counted(number: int, noun: str) -> str:
    """A number and what it counts: ``1 row``, ``2 rows``; the plural ends in s."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
