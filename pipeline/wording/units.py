"""Units in which foreign files give what layout pmg.v1 holds, and what one of each is in SI."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from pmg.sim.errors import BenchError, near_miss
from pmg.sim.signals import REVOLUTION, RPM

if TYPE_CHECKING:
    from collections.abc import Mapping

MILLI = 1e-3
"""SI value of a thousandth."""
TIME = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}
"""Units of a time column [s]."""

FREQUENCY = {"Hz": 1.0, "kHz": 1e3, "MHz": 1e6}
TORQUE = {"N m": 1.0, "mN m": 1e-3, "kN m": 1e3}
IMPERIAL_TORQUE = {"lbf ft": 1.3558179483, "lbf in": 0.1129848290, "ozf in": 0.0070615518, "kgf m": 9.80665}
"""Torques as data sheets and old transducers give them (NIST SP 811, appendix B)."""
ELECTRIC = {"V": 1.0, "mV": 1e-3, "A": 1.0, "mA": 1e-3, "%": 1.0}
"""Units of what a factor makes a torque of; in per cent drives give a part of their rated torque."""
COUNT = {"1": 1.0}
ANGLE = {"rad": 1.0, "mrad": MILLI, "deg": math.pi / 180.0, "rev": REVOLUTION}
SPEED = {"rpm": RPM, "rad/s": 1.0, "deg/s": math.pi / 180.0}

TEMPERATURE_UNITS = {"degC": 1.0, "K": 1.0}
"""Units of a temperature, and what one step of each is in SI."""
ZERO_CELSIUS = 273.15
"""Zero of the Celsius scale [K]."""

KINDS = {
    "frequency": FREQUENCY,
    "torque": TORQUE,
    "electric": ELECTRIC,
    "count": COUNT,
    "angle": ANGLE,
    "speed": SPEED,
    "temperature": TEMPERATURE_UNITS,
}
"""Meaning of a unit for a channel."""

TAKEN = {"frequency": ("frequency", "torque", "electric"), "count": ("count", "angle", "speed")}
"""Kinds of source by the last word of the topic; every other topic takes counts only."""

OTHER_WORDS = {
    "Nm": "N m",
    "N.m": "N m",
    "N·m": "N m",
    "N*m": "N m",
    "mNm": "mN m",
    "lb-ft": "lbf ft",
    "lbf-ft": "lbf ft",
    "ft-lb": "lbf ft",
    "ft-lbf": "lbf ft",
    "ft lbf": "lbf ft",
    "in-lb": "lbf in",
    "lbf-in": "lbf in",
    "in lbf": "lbf in",
    "oz-in": "ozf in",
    "kgm": "kgf m",
    "kNm": "kN m",
    "1/min": "rpm",
    "min-1": "rpm",
    "min^-1": "rpm",
    "U/min": "rpm",
    "°": "deg",
    "°C": "degC",
    "degree": "deg",
    "degrees": "deg",
    "turns": "rev",
    "counts": "1",
    "count": "1",
    "ticks": "1",
    "-": "1",
    "Volt": "V",
    "Volts": "V",
    "percent": "%",
    "pct": "%",
    "sec": "s",
    "seconds": "s",
    "usec": "us",
    "μs": "us",
    "rad/sec": "rad/s",
    "deg/sec": "deg/s",
    "°/s": "deg/s",
    "rev/min": "rpm",
    "r/min": "rpm",
    "RPM": "rpm",
}
"""Other spellings that recorders use."""


def declared(unit: str) -> str:
    """A unit in the spelling of the tables here."""
    plain = unit.strip()
    return OTHER_WORDS.get(plain, plain)


def kind_of(topic: str, unit: str, where: str) -> str:
    """Kind of channel that a unit stands for, for a topic that can be made from it.

    Raises
    ------
    BenchError
        When the topic cannot be made from such a unit; near misses are named.
    """
    plain = declared(unit)
    warm = topic.split("/")[-2:-1] == ["temperature"]
    kinds = ("temperature",) if warm else TAKEN.get(topic.rsplit("/", 1)[-1], ("count",))
    for kind in kinds:
        if plain in KINDS[kind]:
            return kind
    known = [name for kind in kinds for name in KINDS[kind]]
    raise BenchError(f"{where}: unit", f"'{unit}'", f"a unit of which {topic} is made", near_miss(unit, known))


SMALL = 0.1
"""Size in an SI unit below which a value is shown in thousandths of it."""


def displayed(unit: str, size: float, *, share: bool) -> tuple[float, str]:
    """Factor and unit, with a space before it, by which a value of a size is shown: a share of something in per cent.

    A torque below `SMALL` is shown in mN m.
    """
    if unit == "N m" and abs(size) < SMALL:
        return 1.0 / MILLI, " mN m"
    if unit != "1":
        return 1.0, f" {unit}"
    return (100.0, " %") if share else (1.0, "")


def misread(factor: float, units: Mapping[str, float], meant: str, within: float) -> str:
    """Which unit taken for another one makes readings so many times too large; empty where none is near.

    Parameters
    ----------
    factor : float
        Reading over truth.
    units : mapping of str to float
        Units of the quantity, and what one of each is in SI.
    meant : str
        The one that is stated, or that the truth is in.
    within : float
        Part by which the factor may be off that of two units.
    """
    pairs = [(one, meant) for one in units if one != meant] + [(meant, one) for one in units if one != meant]
    off = {pair: abs(factor * units[pair[0]] / units[pair[1]] - 1.0) for pair in pairs}
    nearest = min(off, key=lambda pair: off[pair])
    return f"as if {nearest[0]} were read as {nearest[1]}" if off[nearest] < within else ""
