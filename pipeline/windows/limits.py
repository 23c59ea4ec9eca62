"""Limits of a steady window, such as speed drift, and of a change between two: fixed before any window is looked at."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, fields
from typing import TYPE_CHECKING, Annotated, Any, TypeAlias

from pydantic import BeforeValidator, InstanceOf, model_validator

from pmg.pipeline.files.strict_tables import Strict, refuse, refuse_unknown, refusing
from pmg.pipeline.files.table_file import TableFile, read_table_file
from pmg.pipeline.wording.quantities import RATE, RATIO, SPEED_OF_SHAFT, TIME_SPAN, Dimension, quantity
from pmg.sim.errors import RecordingError
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

SPEEDS = ("speed_change", "speed_offset", "step_speed")
"""Limits that a file may give as numbers in rpm, with that unit in their name."""
WHOLE = ("parts",)
"""Limits that are counts."""
DIMENSIONS: dict[str, Dimension] = {
    **dict.fromkeys(SPEEDS, SPEED_OF_SHAFT),
    **dict.fromkeys(("shortest", "step_beside", "settle"), TIME_SPAN),
    **dict.fromkeys(("frequency_low", "frequency_high"), RATE),
    **dict.fromkeys(("completeness", "speed_change_relative", "speed_offset_relative"), RATIO),
    **dict.fromkeys(("torque_drift", "step_torque"), RATIO),
}
"""Kinds of limits that may be written with their unit, such as ``speed_change = "0.5 rpm"``."""
MAY_BE_ZERO = ("settle", "counts")
TABLE = "windows"
"""Table of the file that holds the limits."""


MEANING = "meaning"
"""Key of the metadata of a field of `Steadiness` with its meaning in a phrase."""


def _limit(value: float, meaning: str) -> Any:  # noqa: ANN401 - what a dataclass takes for a field
    """A limit: its default and its meaning."""
    return field(default=value, metadata={MEANING: meaning})


@dataclass(frozen=True)
class Steadiness:
    """Limits for a steady window.

    Parameters
    ----------
    shortest : float
        Shortest window [s]: two periods of the 0.5 Hz filter's cut-off would be 4 s; below 1 s the batches that
        give the uncertainty are shorter than the control loop's settling.
    completeness : float
        Least part of the length that the test step announces; a shorter one was cut off.
    speed_change : float
        Largest difference between the mean speeds of both halves, and largest standard deviation among the ten
        parts [rad/s]. Half a rpm over a window accelerates the rotors by less than the transducers resolve.
    speed_change_relative : float
        The same, as part of the speed; the larger of both limits holds.
    parts : int
        Parts of the window whose speeds are compared.
    counts : float
        Encoder counts per part that are added to the limit, so that the resolution alone never trips it.
    speed_offset, speed_offset_relative : float
        Largest distance from the set-point [rad/s] and as part of it; the sum of both holds. Beyond, the controller
        has not reached its target or the set-point in the file is another run's.
    torque_drift : float
        Largest change of the torque over the window, largest difference between its halves and largest excursion of
        one of its batches, as part of the nominal torque.
    torque_drift_sigmas : float
        Each must also be this many of its own standard errors: noise alone never trips the check. Warming up
        during a window stays far below both.
    frequency_low, frequency_high : float
        Rated range of the transducers' frequency output [Hz].
    step_speed, step_torque : float
        Where nothing marks the test points: change of a speed [rad/s], or of a torque as part of the nominal one,
        that ends a plateau. Set-points of the bench's grids lie farther apart.
    step_beside : float
        Stretch before and after a place whose means are compared to see such a change [s].
    settle : float
        Time after a change that belongs to no plateau [s].
    """

    shortest: float = _limit(1.0, "shortest window")
    completeness: float = _limit(0.9, "least part of the announced length")
    speed_change: float = _limit(0.5 * RPM, "largest change of a speed within a window")
    speed_change_relative: float = _limit(0.002, "the same, as part of the speed; the larger of both holds")
    parts: int = _limit(10, "parts of a window whose speeds are compared")
    counts: float = _limit(2.0, "encoder counts per part that are added to the change allowed")
    speed_offset: float = _limit(2.0 * RPM, "largest distance of a speed from its set-point")
    speed_offset_relative: float = _limit(0.005, "the same, as part of the set-point; the sum of both holds")
    torque_drift: float = _limit(0.01, "largest change of a torque within a window, as part of the nominal torque")
    torque_drift_sigmas: float = _limit(8.0, "and least size of it, in its own standard errors")
    frequency_low: float = _limit(5_000.0, "lower end of the rated output of the torque transducers")
    frequency_high: float = _limit(15_000.0, "upper end of it")
    step_speed: float = _limit(5.0 * RPM, "change of a speed that ends a plateau where nothing marks the points")
    step_torque: float = _limit(0.02, "the same of a torque, as part of the nominal torque")
    step_beside: float = _limit(1.0, "stretch before and after such a change whose means are compared")
    settle: float = _limit(1.0, "time after such a change that belongs to no plateau")

    def document(self) -> dict[str, float]:
        """As JSON, in SI."""
        return asdict(self)


LIMITS = Steadiness()
MEANINGS: dict[str, str] = {limit.name: limit.metadata[MEANING] for limit in fields(Steadiness)}
"""Meaning of each limit, in a phrase."""


def limit_text(name: str, values: Mapping[str, Any] | None = None) -> str:
    """A limit with its unit, such as ``0.5 rpm``; the default one where no values are given."""
    value = (asdict(LIMITS) if values is None else values)[name]
    dimension = DIMENSIONS.get(name)
    if dimension is None or not isinstance(value, int | float):
        return f"{value:g}" if isinstance(value, int | float) else str(value)
    if name in SPEEDS:
        return f"{value / RPM:.10g} {next(u for u, s in SPEED_OF_SHAFT.units.items() if s == RPM)}"
    if dimension is RATIO:
        return f"{100.0 * value:.10g} %"
    return f"{value:.10g} {dimension.unit}"


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
