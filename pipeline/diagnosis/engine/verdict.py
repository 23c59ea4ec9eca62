"""Verdicts, and what a baseline had absorbed."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Any


class Verdict(StrEnum):
    """Verdicts of a diagnosis."""

    CONSISTENT = "consistent"
    NAMED = "named"
    AMBIGUOUS = "ambiguous"
    NOT_IN_LIBRARY = "not_in_library"
    CONFOUNDED = "confounded"

    @property
    def names(self) -> bool:
        """Whether it says which candidates there may be."""
        return self in (Verdict.NAMED, Verdict.AMBIGUOUS)


@dataclass(frozen=True)
class Absorbed:
    """A baseline parameter before and after what was left out joined the fit, with its standard errors.

    `standard_error` is that after, `error_before` that before; None on a bound or where not determined.
    """

    parameter: str
    before: float
    after: float
    standard_error: float | None
    error_before: float | None = None

    @property
    def document(self) -> dict[str, Any]:
        """The same as JSON."""
        return {name: getattr(self, name) for name in ("parameter", "before", "after", "standard_error")}
