"""Limits of a steady window as a file holds them: the table ``[windows]``, in SI or with units."""

from __future__ import annotations

import math
from dataclasses import fields
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from pydantic import BeforeValidator, InstanceOf, model_validator

from pmg.pipeline.files.strict_tables import Strict, refuse, refuse_unknown, refusing
from pmg.pipeline.files.table_file import TableFile, read_table_file
from pmg.pipeline.windows.limits import DIMENSIONS, LIMITS, SPEEDS, Steadiness
from pmg.pipeline.wording.quantities import quantity
from pmg.sim.errors import RecordingError
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from pathlib import Path

WHOLE = ("parts",)
"""Limits that are counts."""
MAY_BE_ZERO = ("settle", "counts")
TABLE = "windows"
"""Table of the file that holds the limits."""


def _limit_in_si(key: str, given: object) -> tuple[str, float]:
    """One limit of a table: the field of `Steadiness` and its value in SI."""
    names = {f"{f.name}_rpm" if f.name in SPEEDS else f.name: f.name for f in fields(Steadiness)}
    value = given
    refuse_unknown([key], (*names, *SPEEDS), "a limit")
    name = key if key in SPEEDS else names[key]
    if key in DIMENSIONS and isinstance(given, str):
        with refusing(key):
            value = quantity(given, DIMENSIONS[key], "")
    elif key in SPEEDS:
        expected = f'text with a unit such as "{DIMENSIONS[key].example}"'
        refuse(repr(given), expected, f"Or name it {key}_rpm.", key)
    least = 2 if name in WHOLE else 0
    number = value if isinstance(value, int | float) and not isinstance(value, bool) else math.nan
    no_whole = name in WHOLE and number % 1 != 0.0
    if not math.isfinite(number) or number < least or (number == 0 and name not in MAY_BE_ZERO) or no_whole:
        expected = "a whole number from 2" if name in WHOLE else "a finite number above 0"
        refuse(repr(given), expected, "Correct it.", key)
    return name, int(number) if name in WHOLE else float(number) * (RPM if name != key else 1.0)


def _steadiness(table: object) -> Steadiness:
    """The limits of a table."""
    if not isinstance(table, dict):
        refuse(repr(table), "a table", f"Write [{TABLE}] above its keys.")
    found: dict[str, Any] = {}
    for key, given in table.items():
        name, value = _limit_in_si(key, given)
        if name in found:
            refuse("given twice", f"{name} or {name}_rpm", "Leave one of them out.", key)
        found[name] = value
    limits = Steadiness(**found)
    low, high = limits.frequency_low, limits.frequency_high
    if low >= high:
        came = f"frequency_low {low:g} Hz and frequency_high {high:g} Hz"
        refuse(came, "the lower one first", "Correct them.")
    return limits


WindowsTable: TypeAlias = Annotated[InstanceOf[Steadiness], BeforeValidator(_steadiness)]
"""Table ``[windows]``."""


class LimitsFile(Strict):
    """A file with a table ``[windows]`` of limits that differ from the defaults.

    Keys are the fields of `Steadiness`, values numbers in SI, or text with a unit; speeds that are numbers are given in
    rpm, as ``speed_change_rpm``.
    """

    windows: WindowsTable

    @model_validator(mode="before")
    @classmethod
    def _all_in_one(cls, given: dict[str, Any]) -> dict[str, Any]:
        for loose in (key for key in given if key != TABLE):
            refuse("outside the table", f"one table [{TABLE}]", "Put all limits into it.", loose)
        return given


def limits_file(path: Path) -> TableFile[LimitsFile]:
    """A file of limits.

    Raises
    ------
    RecordingError
        The file cannot be read, or holds a key or a value that is none.
    """
    return read_table_file(path, f"a table [{TABLE}]", LimitsFile, RecordingError)


def _read_limits(path: Path) -> Steadiness:
    """The limits in a file, as `limits_file` reads it."""
    return limits_file(path).table.windows


def chosen_limits(given: Path | Steadiness | None) -> Steadiness:
    """The limits of a call: those given, or those of a file, or the defaults."""
    if given is None:
        return LIMITS
    return given if isinstance(given, Steadiness) else _read_limits(given)
