"""Tolerances of simulation against bench for a user's purpose, written with units."""

from __future__ import annotations

import re

from pmg.pipeline.wording.quantities import POWER, RATIO, TORQUE_OF_SHAFT, Dimension, quantity
from pmg.sim.errors import BenchError, near_miss
from pmg.sim.signals import EFFICIENCY_TOTAL, LOSS_TOTAL, TORQUE_RING, TORQUE_SUN

Tolerances = dict[str, tuple[float, float]]
"""By name of the signal: an absolute part [SI], and a part relative to the measured value."""

SIGNALS: dict[str, tuple[str, Dimension]] = {
    TORQUE_SUN.name: (TORQUE_SUN.name, TORQUE_OF_SHAFT),
    TORQUE_RING.name: (TORQUE_RING.name, TORQUE_OF_SHAFT),
    LOSS_TOTAL.name: (LOSS_TOTAL.name, POWER),
    "loss": (LOSS_TOTAL.name, POWER),
    EFFICIENCY_TOTAL.name: (EFFICIENCY_TOTAL.name, RATIO),
    "efficiency": (EFFICIENCY_TOTAL.name, RATIO),
}
"""Words for what is compared: name of the signal, and what it is."""


def tolerance(word: str, text: str, where: str) -> tuple[str, tuple[float, float]]:
    """The tolerance of one signal.

    Parameters
    ----------
    word : str
        A key of `SIGNALS`.
    text : str
        An absolute part, a relative one in per cent, or both joined by ``or``, such as ``"10 mN m or 2 %"``. Of an
        efficiency per cent are points: its tolerance is absolute.
    where : str
        Where it stands.

    Returns
    -------
    (str, (float, float))
        Name of the signal; absolute part [SI] and relative part, 0 where there is none. The larger of absolute and
        relative * abs(measured) holds.

    Raises
    ------
    BenchError
        The signal is not compared, or the text is no tolerance.
    """
    if word not in SIGNALS:
        raise BenchError(where, f"'{word}'", "a signal that is compared", near_miss(word, SIGNALS))
    name, dimension = SIGNALS[word]
    parts: dict[bool, float] = {}
    for part in re.split(r"\s+or\s+", text):
        relative = dimension is not RATIO and part.strip().endswith("%")
        value = quantity(part, RATIO if relative else dimension, where)
        if relative in parts:
            raise BenchError(where, f'"{text}"', "at most one absolute and one relative part", "Leave one of each.")
        if value <= 0.0:
            raise BenchError(where, f'"{text}"', "a tolerance above 0", "Correct it.")
        parts[relative] = value
    return name, (parts.get(False, 0.0), parts.get(True, 0.0))
