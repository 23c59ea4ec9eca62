r"""Laws of temperature: the viscosity of a lubricant, and what is left of magnetic drag as magnets weaken.

References
----------
ASTM D341: :math:`\log\log(\nu+0.7) = A - B \log T` (Walther), A from the grade by ISO 3448.
Vogel, H. (1921). Das Temperaturabhängigkeitsgesetz der Viskosität von Flüssigkeiten. Physik. Z. 22, 645-646;
:math:`e^{B/(T+C)}`, C about 95 K after Cameron (1966).
Slotte, K. F. (1892). Ueber die innere Reibung einiger Flüssigkeiten. Öfvers. Finska Vetensk.-Soc.: a power of a
temperature that is shifted.
Roelands, C. J. A. (1966). Correlational Aspects of the Viscosity-Temperature-Pressure Relationship of Lubricating
Oils: :math:`\ln\eta + 9.67 \propto (T+135\,°C)^{-S}`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.trials.laws import Families, Law

if TYPE_CHECKING:
    from pmg.sim.signals import Array

KELVIN = 273.15
REFERENCE = 40.0
"""Temperature at which the drag curves hold, and grades are given [degC]."""
WALTHER_SHIFT = 0.7
"""Shift of the kinematic viscosity in Walther's law [mm²/s]."""
ROELANDS = 135.0
"""Shift of the temperature in Roelands's law [K]."""


def _walther(temperature: Array, grade: float, slope: float) -> Array:
    """Walther's law of an oil of that ISO grade."""
    start = np.log10(np.log10(grade + WALTHER_SHIFT))
    double = start - slope * np.log10((temperature + KELVIN) / (REFERENCE + KELVIN))
    return np.asarray(np.log((10.0**10.0**double - WALTHER_SHIFT) / grade))


def _vogel(temperature: Array, b: float, c: float) -> Array:
    return np.asarray(b / (temperature + c) - b / (REFERENCE + c))


def _slotte(temperature: Array, shift: float, power: float) -> Array:
    return np.asarray(-power * np.log1p((temperature - REFERENCE) / shift))


def _roelands(temperature: Array, start: float, slope: float) -> Array:
    """Roelands's law; `start` is the logarithm of the viscosity at the reference over 6.3e-5 Pa s."""
    return np.asarray(start * (((temperature + ROELANDS) / (REFERENCE + ROELANDS)) ** -slope - 1.0))


def _flux_linear(weaker: Array) -> Array:
    """With the flux itself, as when a field of the rotors meets that of the load."""
    return np.asarray(1.0 - weaker)


def _flux_curved(weaker: Array, curve: float) -> Array:
    """With the square of a flux that falls faster and faster."""
    return np.asarray((1.0 - weaker - curve * weaker**2) ** 2)


def _flux_conducting(weaker: Array, resistance: float) -> Array:
    """With the square of the flux, over a resistance that rises meanwhile."""
    return np.asarray((1.0 - weaker) ** 2 / (1.0 + resistance * weaker))


def _flux_steinmetz(weaker: Array) -> Array:
    return np.asarray((1.0 - weaker) ** 1.6)


VISCOSITY = Families(
    {
        "walther": Law(_walther, {"grade": (32.0, 150.0), "slope": (3.3, 3.7)}),
        "vogel": Law(_vogel, {"b": (700.0, 1100.0), "c": (80.0, 110.0)}),
        "slotte": Law(_slotte, {"shift": (55.0, 75.0), "power": (2.0, 3.5)}),
    },
    {"roelands": Law(_roelands, {"start": (6.1, 7.6), "slope": (1.0, 1.4)})},
)
"""Of temperature [degC]: logarithm of the viscosity over that at the reference temperature."""
MAGNETS = Families(
    {
        "linear": Law(_flux_linear),
        "curved": Law(_flux_curved, {"curve": (1.0, 4.0)}),
        "conducting": Law(_flux_conducting, {"resistance": (2.0, 5.0)}),
    },
    {"steinmetz": Law(_flux_steinmetz)},
)
"""Of the part of the flux that is gone: what is left of the drag."""
