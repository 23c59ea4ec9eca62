"""Quantities that a user writes with their unit, such as ``"10 mN m"``, in SI."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from pmg.pipeline.wording.units import FREQUENCY, SPEED, TIME, TORQUE, declared
from pmg.sim.errors import BenchError, PmgError, near_miss

if TYPE_CHECKING:
    from collections.abc import Mapping


@dataclass(frozen=True)
class Dimension:
    """Kind of a quantity.

    Parameters
    ----------
    name : str
        A word for messages.
    units : mapping of str to float
        Units it may be written in, and the SI value of one of each.
    example : str
        How it may be written.
    """

    name: str
    units: Mapping[str, float]
    example: str

    @property
    def unit(self) -> str:
        """The SI unit."""
        return next(unit for unit, scale in self.units.items() if scale == 1.0)


RATIO_UNITS = {"1": 1.0, "%": 1e-2, "ppm": 1e-6}
SPEED_OF_SHAFT = Dimension("a speed", SPEED, "1500 rpm")
TORQUE_OF_SHAFT = Dimension("a torque", TORQUE, "10 mN m")
TIME_SPAN = Dimension("a time", TIME, "2.5 s")
RATE = Dimension("a frequency", FREQUENCY, "0.5 Hz")
POWER = Dimension("a power", {"W": 1.0, "mW": 1e-3, "kW": 1e3}, "0.5 W")
RATIO = Dimension("a ratio", RATIO_UNITS, "1 %")
DIMENSIONS = (SPEED_OF_SHAFT, TORQUE_OF_SHAFT, TIME_SPAN, RATE, POWER, RATIO)

_FORM = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*", flags=re.ASCII)


def quantity(text: str, dimension: Dimension, where: str, error: type[PmgError] = BenchError) -> float:
    """The quantity that a text names, in SI.

    Parameters
    ----------
    text : str
        A number and a unit.
    dimension : Dimension
        What it has to be.
    where : str
        Where it stands.
    error : type of PmgError
        What a refusal is raised as.

    Raises
    ------
    PmgError
        It is no number with a unit, or one of another dimension.
    """
    expected = f'{dimension.name} such as "{dimension.example}"'
    found = _FORM.fullmatch(text)
    if found is None:
        raise error(where, f'"{text}"', expected, "Write a number, a blank and the unit.")
    unit = declared(found[2])
    if unit == "" and "1" in dimension.units:
        unit = "1"
    if unit not in dimension.units:
        other = next((d.name for d in DIMENSIONS if unit in d.units), None)
        came = f'"{text}", {other}' if other else f'"{text}"' if unit else f'"{text}", which has no unit'
        raise error(where, came, expected, near_miss(unit, dimension.units))
    value = float(found[1]) * dimension.units[unit]
    if not math.isfinite(value):
        raise error(where, f'"{text}"', "a finite number", "Correct it.")
    return value
