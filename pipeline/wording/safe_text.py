"""Text of a recording made harmless where it is shown: terminal, page, spreadsheet."""

from __future__ import annotations

import json
import unicodedata

STEERING = ("Cc", "Cf", "Cs", "Zl", "Zp")
"""Categories of signs that steer a terminal or the direction of a text, or end a line of it."""
FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""Signs with which a cell of a spreadsheet begins that is taken for a formula."""


def printable(text: str) -> str:
    """The text with every sign that would steer a terminal or a page written as its code, such as ``\\x1b``."""
    if text.isprintable():
        return text
    return "".join(repr(sign)[1:-1] if unicodedata.category(sign) in STEERING else sign for sign in text)


def printable_lines(text: str) -> str:
    """The same for text of several lines; tabs stay."""
    return "\n".join("\t".join(map(printable, line.split("\t"))) for line in text.split("\n"))


def printable_json(document: str) -> str:
    """A JSON document with every such sign written as JSON's own escape; it reads back as the same."""
    signs = {sign for sign in set(document) if sign != "\n" and unicodedata.category(sign) in STEERING}
    return document.translate({ord(sign): json.dumps(sign)[1:-1] for sign in signs})


def spreadsheet_text(text: str) -> str:
    """A text cell that no spreadsheet takes for a formula: with an apostrophe before it; numbers stay numbers.

    References
    ----------
    OWASP, CSV injection: cells that begin with ``= + - @``, tab or carriage return.
    """
    if not text.startswith(FORMULA):
        return text
    try:
        float(text)
    except ValueError:
        return f"'{text}"
    return text
