"""The nomenclature: every channel and quantity, its symbol and its unit, written once."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from pmg.sim.shafts import PerShaft

Array = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
Spectrum = npt.NDArray[np.complex128]

Number: TypeAlias = Any
"""Argument of plain arithmetic: a float, a complex number or an array of either."""

RPM = math.pi / 30.0
"""One revolution per minute [rad/s]."""

MINUTE = 60.0
"""One minute [s]."""

HOUR = 3600.0
"""One hour [s]."""
REVOLUTION = 2.0 * math.pi
"""One turn [rad]."""
NORMAL_MAD = 1.482602218505602
"""Standard deviation of normal numbers over the median of their absolute deviations."""


def wrapped(angle: Array | float) -> Array:
    """The angle between -pi and pi [rad]."""
    return np.asarray(np.angle(np.exp(1j * np.asarray(angle))))


@dataclass(frozen=True)
class Signal:
    """A measured, simulated or derived quantity.

    Parameters
    ----------
    name : str
        Field and column name; SI when it carries no unit.
    symbol : str
        Symbol of the thesis, as LaTeX without dollar signs.
    unit : str
        SI unit.
    display_unit : str
        Unit of tables and figures.
    scale : float
        SI value of one display unit.
    meaning : str
        One phrase for captions.
    """

    name: str
    symbol: str
    unit: str
    display_unit: str
    scale: float
    meaning: str

    def display(self, value: npt.ArrayLike) -> Array:
        """Value in the display unit."""
        return np.asarray(value, dtype=np.float64) / self.scale

    @property
    def display_name(self) -> str:
        """Column name in tables for people: the name, with its display unit where it is not SI."""
        suffix = {"N m": "Nm", "%": "percent", "mN m": "mNm", "N m s/rad": "Nms"}.get(self.display_unit)
        return f"{self.name}_{suffix or self.display_unit}"

    @property
    def label(self) -> str:
        """Axis label."""
        return f"{self.meaning} [{self.display_unit}]"


SPEED_SUN = Signal("speed_sun", r"n_s", "rad/s", "rpm", RPM, "sun speed")
SPEED_RING = Signal("speed_ring", r"n_r", "rad/s", "rpm", RPM, "ring speed")
TORQUE_SUN = Signal("torque_sun", r"T_s", "N m", "N m", 1.0, "sun torque")
TORQUE_RING = Signal("torque_ring", r"T_r", "N m", "N m", 1.0, "ring torque")
LOSS_TORQUE_SUN = Signal("loss_torque_sun", r"T_{bs}", "N m", "N m", 1.0, "sun bearing loss torque")
LOSS_TORQUE_RING = Signal("loss_torque_ring", r"T_{br}", "N m", "N m", 1.0, "ring bearing loss torque")
SPEEDS = PerShaft(SPEED_SUN, SPEED_RING)
TORQUES = PerShaft(TORQUE_SUN, TORQUE_RING)
LOSS_TORQUES = PerShaft(LOSS_TORQUE_SUN, LOSS_TORQUE_RING)
RESIDUAL = Signal("residual", r"\Delta T", "N m", "mN m", 1e-3, "measured minus simulated torque")
POWER_SUN = Signal("power_sun", r"P_s", "W", "W", 1.0, "mechanical power that the sun motor puts in")
POWER_RING = Signal("power_ring", r"P_r", "W", "W", 1.0, "mechanical power that the ring motor puts in")
POWER_IN = Signal("power_in", r"P_\mathrm{in}", "W", "W", 1.0, "mechanical power put in")
POWER_OUT = Signal("power_out", r"P_\mathrm{out}", "W", "W", 1.0, "mechanical power taken out")
LOSS_TOTAL = Signal("loss_total", r"P_\mathrm{tot}", "W", "W", 1.0, "total loss")
LOSS_BEARINGS = Signal("loss_bearings", r"P_b", "W", "W", 1.0, "bearing loss")
LOSS_MAGNETIC = Signal("loss_magnetic", r"P_m", "W", "W", 1.0, "magnetic loss")
EFFICIENCY_TOTAL = Signal("efficiency_total", r"\eta_\mathrm{tot}", "1", "%", 0.01, "total efficiency")
EFFICIENCY_MAGNETIC = Signal("efficiency_magnetic", r"\eta_m", "1", "%", 0.01, "magnetic efficiency")
EFFICIENCY_BEARINGS = Signal("efficiency_bearings", r"\eta_b", "1", "%", 0.01, "bearing efficiency")
