"""Identifiers that serve as HTML anchor and as file name on every system."""

from __future__ import annotations

import re

_PLAIN = re.compile(r"[a-z][a-z0-9]*(?:[-_][a-z0-9]+)*")


def checked_id(owner: str, identifier: str) -> str:
    """The identifier itself, once it is known to be safe.

    Raises
    ------
    ValueError
        When it holds anything but lower-case letters, digits, and single hyphens or underscores between them.
    """
    if not _PLAIN.fullmatch(identifier):
        raise ValueError(
            f"{owner} id {identifier!r}: expected lower-case letters, digits, hyphens or underscores, a letter first"
        )
    return identifier
