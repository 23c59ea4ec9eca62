"""Numbers about a machine: value, unit, standard uncertainty and source of each, in SI."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.files.strict_tables import Strict, number_within, refuse, word_of
from pmg.pipeline.machine.axis import DEGREE
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

MOST_STATED = 1e13
"""Largest value of a number about a machine."""

UNITS: dict[str, Mapping[str, float]] = {
    "number": {"1": 1.0, "%": 0.01},
    "frequency": {"Hz": 1.0, "kHz": 1e3},
    "resistance": {"ohm": 1.0, "mohm": 1e-3},
    "inductance": {"H": 1.0, "mH": 1e-3},
    "area": {"m2": 1.0, "cm2": 1e-4, "mm2": 1e-6},
    "time": {"s": 1.0, "ms": 1e-3},
    "rate": {"1/s": 1.0},
    "voltage per torque": {"V/(N m)": 1.0},
    "voltage": {"V": 1.0, "mV": 1e-3},
    "current": {"A": 1.0, "mA": 1e-3},
}
"""Units of what a machine that slides and one that turns have alike; the first of each is that of SI."""

TURNING: dict[str, Mapping[str, float]] = {
    "inertia": {"kg m2": 1.0, "kg cm2": 1e-4, "kg mm2": 1e-6, "g cm2": 1e-7},
    "drive": {"N m": 1.0, "mN m": 1e-3, "kN m": 1e3},
    "stiffness": {"N m/rad": 1.0, "kN m/rad": 1e3, "N m/deg": 1.0 / DEGREE},
    "damping": {"N m s/rad": 1.0, "mN m s/rad": 1e-3, "N m/rpm": 1.0 / RPM},
    "drive per current": {"N m/A": 1.0, "mN m/A": 1e-3},
    "voltage per speed": {"V s/rad": 1.0, "V/rpm": 1.0 / RPM},
    "way": {"rad": 1.0, "mrad": 1e-3, "deg": DEGREE},
}
"""Units of a machine that turns."""

SLIDING: dict[str, Mapping[str, float]] = {
    "inertia": {"kg": 1.0, "g": 1e-3},
    "drive": {"N": 1.0, "kN": 1e3},
    "stiffness": {"N/m": 1.0, "N/mm": 1e3, "kN/m": 1e3},
    "damping": {"N s/m": 1.0, "N s/mm": 1e3},
    "drive per current": {"N/A": 1.0},
    "voltage per speed": {"V s/m": 1.0},
    "way": {"m": 1.0, "mm": 1e-3, "um": 1e-6},
}
"""Units of a machine that slides."""


class QuantityTable(Strict):
    """A number as a file gives it: ``{ value = 5, unit = "N m", u = 0.1, source = "nameplate" }``."""

    value: float
    unit: str
    u: float | None = None
    source: str = ""


@dataclass(frozen=True)
class Stated:
    """A number about a machine.

    Parameters
    ----------
    value : float
        In SI.
    unit : str
        Its unit in SI.
    u : float or None
        Standard uncertainty in SI; None where none is stated.
    source : str
        Where it is taken from; empty where that is not said.
    """

    value: float
    unit: str
    u: float | None
    source: str

    def written(self) -> str:
        """Value with its uncertainty, or marked as without one."""
        unit = "" if self.unit == "1" else f" {self.unit}"
        spread = " (no uncertainty stated)" if self.u is None else f" ± {self.u:.2g}"
        return f"{self.value:.6g}{spread}{unit}" if self.u is not None else f"{self.value:.6g}{unit}{spread}"


def summed(parts: Sequence[tuple[Stated, float]]) -> Stated:
    """Sum of numbers, each times a factor; its uncertainty where all have one, and their sources."""
    spread = [one.u * factor for one, factor in parts if one.u is not None]
    sources = "; ".join(dict.fromkeys(one.source for one, _ in parts if one.source))
    u = math.hypot(*spread) if len(spread) == len(parts) else None
    return Stated(sum(one.value * factor for one, factor in parts), parts[0][0].unit, u, sources)


def stated(table: QuantityTable, kind: str, source: str, slides: bool = False, *, signed: bool = False) -> Stated:
    """A number of a file in SI.

    Parameters
    ----------
    table : QuantityTable
        As the file gives it.
    kind : str
        What it is, one of `UNITS`, `TURNING` and `SLIDING`.
    source : str
        Of what names none.
    slides : bool
        Whether the machine slides.
    signed : bool
        Whether it may be negative.

    Raises
    ------
    RefusalError
        The unit is of another kind, or a number is not finite or negative.
    """
    known = (UNITS | (SLIDING if slides else TURNING))[kind]
    factor = known[word_of(table.unit, known, "unit")]
    for key, value in (("value", table.value), ("u", 0.0 if table.u is None else table.u)):
        if not math.isfinite(value):
            refuse(f"{value}", "a finite number", "Correct the value.", key)
    number_within(abs(table.value), 0.0, MOST_STATED)
    if table.value < 0.0 and not signed:
        refuse(f"{table.value:g}", "zero or more", "Correct the value.", "value")
    if table.u is not None and table.u < 0.0:
        refuse(f"{table.u:g}", "a standard uncertainty of zero or more", "Correct the value.", "u")
    u = None if table.u is None else table.u * factor
    return Stated(table.value * factor, next(iter(known)), u, table.source or source)
