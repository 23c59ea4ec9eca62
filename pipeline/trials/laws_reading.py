"""Laws of faulty torque readings: zeros that move with time, gains that change with torque, crosstalk.

`t` is time in lengths of the campaign, `x` a torque over the nominal one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.trials.laws import Families, Law
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.sim.signals import Array

WALK_TERMS = 8
"""Terms of the sine expansion of a random walk."""
EVENLY = 3.0**0.5
"""Numbers spread evenly between minus and plus this have standard deviation 1."""


def _constant(t: Array) -> Array:
    return np.ones_like(t)


def _zero_walk(t: Array, trend: float, **walk: float) -> Array:
    """A random walk by its sine expansion, in addition to a trend."""
    found = trend * t
    for i in range(WALK_TERMS):
        rate = 0.25 * (2 * i + 1)  # turns over the campaign
        found = found + 0.4 * walk[f"walk_{i}"] * np.sin(REVOLUTION * rate * t) / (REVOLUTION * rate)
    return found


def _zero_late(t: Array, middle: float, width: float) -> Array:
    """Still at first, then a step that takes its time."""
    return np.asarray(0.5 * (np.tanh((t - middle) / width) + np.tanh(middle / width)))


def _zero_two_rates(t: Array, fast: float, slow: float, first: float) -> Array:
    """Two exponentials: electronics that warm and a body that follows, in either sense."""
    return np.asarray(-first * np.expm1(-t / fast) - (1.0 - first) * np.expm1(-t / slow))


def _zero_creep(t: Array, onset: float) -> Array:
    """Creep of the strain gauges, with the logarithm of time."""
    return np.asarray(np.log1p(t / onset) / np.log1p(1.0 / onset))


def _zero_diffusing(t: Array, settled: float) -> Array:
    """Heat that diffuses into a body: the root of time at first, settled in the end."""
    return np.asarray(np.sqrt(-np.expm1(-t / settled)))


def _gain_quadratic(x: Array, quadratic: float) -> Array:
    return np.asarray(1.0 + quadratic * np.abs(x))


def _gain_cubic(x: Array, cubic: float) -> Array:
    return np.asarray(1.0 + cubic * x * x)


def _gain_by_sense(x: Array, sense: float) -> Array:
    """Not the same for both senses of the torque."""
    return np.asarray(1.0 + sense * np.sign(x))


def _gain_levelling(x: Array, span: float) -> Array:
    """Falling as the torque nears what the transducer can show."""
    least = np.maximum(np.abs(x) / span, 1e-6)
    return np.asarray(np.tanh(least) / least)


def _gain_dead_band(x: Array, band: float) -> Array:
    """None of it at the smallest torques."""
    return np.asarray(x * x / (x * x + band * band))


def _shown_lag(x: Array, before: Array, lag: float) -> Array:
    """A little of it still that of the point before."""
    return np.asarray(x + lag * (before - x))


def _shown_magnitude(x: Array, before: Array, power: float) -> Array:
    """Without its sign, as a couple that bends the shaft."""
    return np.asarray(np.abs(x) ** power)


def _shown_by_sense(x: Array, before: Array, power: float, backwards: float) -> Array:
    """Another part of it in the other sense."""
    return np.asarray(np.abs(x) ** power * np.where(x > 0.0, 1.0, -backwards))


def _shown_seated(x: Array, before: Array, play: float) -> Array:
    """Without its sign, and only once a coupling's play is taken up."""
    return np.asarray(np.hypot(x, play) - play)


def _shown_stiffening(x: Array, before: Array, knee: float) -> Array:
    """Growing faster than the torque."""
    return np.asarray(x * (1.0 + (x / knee) ** 2))


OFFSET = Families({"constant": Law(_constant)})
"""Of time."""
DRIFT = Families(
    {
        "walk": Law(_zero_walk, {"trend": (0.6, 1.5)} | {f"walk_{i}": (-EVENLY, EVENLY) for i in range(WALK_TERMS)}),
        "late": Law(_zero_late, {"middle": (0.4, 0.8), "width": (0.08, 0.2)}),
        "two_rates": Law(_zero_two_rates, {"fast": (0.05, 0.2), "slow": (0.6, 2.0), "first": (-0.5, 0.6)}),
        "creep": Law(_zero_creep, {"onset": (0.01, 0.1)}),
    },
    {"diffusing": Law(_zero_diffusing, {"settled": (0.15, 1.2)})},
)
"""Of time; nothing at the start."""
GAIN = Families(
    {
        "quadratic": Law(_gain_quadratic, {"quadratic": (-0.3, 0.3)}),
        "cubic": Law(_gain_cubic, {"cubic": (-1.5, 1.5)}),
        "by_sense": Law(_gain_by_sense, {"sense": (-0.15, 0.15)}),
    },
    {
        "levelling": Law(_gain_levelling, {"span": (0.4, 1.2)}),
        "dead_band": Law(_gain_dead_band, {"band": (5e-3, 2e-2)}),
    },
)
"""Of torque; about 1."""
CROSSTALK = Families(
    {
        "lag": Law(_shown_lag, {"lag": (0.02, 0.1)}),
        "magnitude": Law(_shown_magnitude, {"power": (0.8, 1.2)}),
        "by_sense": Law(_shown_by_sense, {"power": (0.85, 1.25), "backwards": (-0.3, 0.8)}),
        "seated": Law(_shown_seated, {"play": (0.02, 0.1)}),
    },
    {"stiffening": Law(_shown_stiffening, {"knee": (0.15, 0.4)})},
)
"""Of the other torque, now and at the point before; nothing without torque."""
