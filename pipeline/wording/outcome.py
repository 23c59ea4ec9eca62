"""What a stage did, as the command line tells it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Outcome:
    """What a stage did.

    Parameters
    ----------
    data : dict
        Results, as JSON.
    lines : tuple of str
        The same for people, a few lines.
    findings : tuple of dict
        Remarks: severity, where, message.
    partial : bool
        Something was left out that a new call, with better input, could add.
    mismatch : bool
        Simulation and recordings differ.
    failed : bool
        Nothing can be done with what was given; what was found is told all the same.
    """

    data: dict[str, Any]
    lines: tuple[str, ...]
    findings: tuple[dict[str, Any], ...] = ()
    partial: bool = False
    mismatch: bool = False
    failed: bool = False


def told(severity: str, where: str, message: str) -> dict[str, Any]:
    """A finding of a stage: ``error``, ``warning`` or ``info``, its place, and what was found."""
    return {"severity": severity, "where": where, "message": message}
