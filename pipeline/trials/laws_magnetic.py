r"""Laws of magnetic drag: poles that slip in neutral, shielded eddy currents, iron loss under load.

References
----------
Smythe, W. R. (1942). On eddy currents in a rotating disk. Trans. AIEE 61, 681-684: torque that falls beyond a
critical speed, otherwise than :math:`2x/(1+x^2)`.
Stoll, R. L. (1974). The Analysis of Eddy Currents: slabs and cylinders in prescribed flux or prescribed field.
Steinmetz, C. P. (1892). On the law of hysteresis. Trans. AIEE 9, 1-64: loss with the power 1.6 of the flux density.
Bertotti, G. (1988). General properties of power losses in soft ferromagnetic materials. IEEE Trans. Magnetics 24,
621-630: excess loss with the power 1.5 of flux density and frequency.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ive

from pmg.pipeline.trials.laws import Families, Law

if TYPE_CHECKING:
    from pmg.sim.signals import Array

THIN = 1e-2
"""Thickness over depth below which a part is not shielded at all."""


def _slip_exponential(x: Array) -> Array:
    return np.asarray(x * np.exp(1.0 - x))


def _slip_saturating(x: Array) -> Array:
    """A hyperbolic tangent that falls again."""
    return np.asarray(np.tanh(1.5 * x) / (1.0 + 0.25 * x))


def _slip_algebraic(x: Array, power: float) -> Array:
    return np.asarray(2.0 * x / (1.0 + x**power))


def _slip_root(x: Array, fall: float) -> Array:
    """Saturates with a root, and falls slowly beyond."""
    return np.asarray(x / np.sqrt(1.0 + x * x) / (1.0 + fall * x))


def _depth(speed: Array, corner: float) -> Array:
    """Thickness over the depth that the currents reach."""
    return np.maximum(np.sqrt(speed / corner), THIN)


def _skin_slab(speed: Array, corner: float) -> Array:
    x = _depth(speed, corner)
    return np.asarray(np.tanh(x) / x)


def _skin_lamination(speed: Array, corner: float) -> Array:
    """A sheet that carries a prescribed flux."""
    x = _depth(speed, corner)
    return np.asarray(3.0 / x * (np.sinh(x) - np.sin(x)) / (np.cosh(x) - np.cos(x)))


def _skin_field(speed: Array, corner: float) -> Array:
    """A sheet in a prescribed field: beyond its corner the torque falls."""
    x = _depth(speed, corner)
    return np.asarray(6.0 / x**3 * (np.sinh(x) - np.sin(x)) / (np.cosh(x) + np.cos(x)))


def _skin_cylinder(speed: Array, corner: float) -> Array:
    """A cylinder along a prescribed field."""
    x = _depth(speed, corner)
    z = x * np.sqrt(1j)
    return np.asarray(-8.0 / x**2 * np.imag(2.0 * ive(1, z) / (z * ive(0, z))))


def _skin_two_slabs(speed: Array, corner: float, part: float) -> Array:
    """Slabs of two thicknesses."""
    return np.asarray(part * _skin_slab(speed, corner) + (1.0 - part) * _skin_slab(speed, 10.0 * corner))


def _iron_power(load: Array, v: Array, load_power: float, speed_power: float) -> Array:
    return np.asarray(load**load_power * v**speed_power)


def _iron_hysteresis_eddy(load: Array, v: Array, hysteresis: float) -> Array:
    """Steinmetz's hysteresis, whose torque does not depend on speed, in addition to eddy currents."""
    return np.asarray(hysteresis * load**1.6 + (1.0 - hysteresis) * load**2 * v)


def _iron_saturating(load: Array, v: Array, knee: float, speed_power: float) -> Array:
    """The square of the load below a knee, levelling off beyond."""
    return np.asarray((1.0 + knee**2) * load**2 / (knee**2 + load**2) * v**speed_power)


def _iron_excess(load: Array, v: Array, excess: float) -> Array:
    """Excess loss in addition to eddy currents."""
    return np.asarray(excess * load**1.5 * v**0.5 + (1.0 - excess) * load**2 * v)


def _iron_exponential(load: Array, v: Array, growth: float, speed_power: float) -> Array:
    """Growing ever faster with load, as flux leaks into parts that had none."""
    return np.asarray(np.expm1(growth * load) / np.expm1(growth) * v**speed_power)


COUPLING = Families(
    {
        "exponential": Law(_slip_exponential),
        "saturating": Law(_slip_saturating),
        "algebraic": Law(_slip_algebraic, {"power": (1.3, 1.7)}),
    },
    {"root": Law(_slip_root, {"fall": (0.05, 0.2)})},
)
"""Of slip over a reference one; nothing without slip."""
SKIN = Families(
    {
        "slab": Law(_skin_slab, {"corner": (10.0, 50.0)}),
        "lamination": Law(_skin_lamination, {"corner": (2.0, 12.0)}),
        "field": Law(_skin_field, {"corner": (5.0, 40.0)}),
    },
    {
        "cylinder": Law(_skin_cylinder, {"corner": (5.0, 40.0)}),
        "two_slabs": Law(_skin_two_slabs, {"corner": (2.0, 10.0), "part": (0.3, 0.7)}),
    },
)
"""Of speed [rad/s]: part of the torque without shielding, 1 at rest."""
IRON = Families(
    {
        "power": Law(_iron_power, {"load_power": (1.2, 2.0), "speed_power": (0.7, 1.3)}),
        "hysteresis_eddy": Law(_iron_hysteresis_eddy, {"hysteresis": (0.1, 0.5)}),
        "saturating": Law(_iron_saturating, {"knee": (0.4, 1.0), "speed_power": (0.9, 1.2)}),
    },
    {
        "excess": Law(_iron_excess, {"excess": (0.5, 1.0)}),
        "exponential": Law(_iron_exponential, {"growth": (1.0, 3.0), "speed_power": (0.8, 1.2)}),
    },
)
"""Of load over a reference one and of speed over the highest one; nothing without load."""
