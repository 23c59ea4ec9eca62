"""Factors of short forms, each of one covariate: powers, decay, saturation, swing, sign, step, peak."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.sim.signals import Array

POWERS = tuple(Fraction(n, 2) for n in (1, 2, 3, 4, 6))
"""Exponents of the powers."""

SCALES = 10
"""Values of a decay's or a saturation's constant from which a fit starts, evenly on a logarithm."""

MOST_CYCLES = 64.0
"""Most periods within the range of a covariate."""

APART = 0.008
"""Part of a covariate's range that neighbouring set-points lie apart, at least."""

RESOLUTION = 400.0
"""Levels that the range of a covariate without set-points is separated into."""


@dataclass(frozen=True, eq=False)
class FormCovariate:
    """Covariate of a formula.

    Parameters
    ----------
    name : str
        As a location names it.
    symbol : str
        In formulas.
    unit : str
        SI unit.
    meaning : str
        One phrase.
    values : (n,) array
        At the readings of the location, SI.
    signed : bool
        Whether it takes both signs.
    memory : bool
        Whether it is a memory of the run: several of them then stand for one quantity, and only powers are tried.
    """

    name: str
    symbol: str
    unit: str
    meaning: str
    values: Array
    signed: bool = False
    memory: bool = False


@dataclass(frozen=True)
class Atom:
    """A factor of one covariate.

    Parameters
    ----------
    name : str
        Unique.
    branches : tuple of str
        Its formula, in the syntax of sympy; ``{x}`` is the covariate, ``{m}`` its magnitude, ``{0}`` and ``{1}`` the
        constants. Two branches have a linear constant each.
    constants : tuple of str
        First letters of the names of the constants; a ``s`` or ``P`` is a scale or a period, ``p`` a place.
    value : callable
        Covariate (n, 1) and constants, each (g,), to branches, each (n, g).
    grid : callable
        Covariate (n,) to constants from which fits start (g, k).
    power : Fraction
        Power of the covariate's unit that it carries.
    searched : bool
        Whether the constants are refined beyond the grid; otherwise the grid holds every value that differs.
    """

    name: str
    branches: tuple[str, ...]
    constants: tuple[str, ...]
    value: Callable[..., tuple[Array, ...]]
    grid: Callable[[Array], Array]
    power: Fraction = Fraction(0)
    searched: bool = True


def levels(x: Array) -> Array:
    """Distinct values of a covariate, rising: its set-points, which are met only nearly, by their means.

    A covariate has set-points when its values lie in heaps that are narrower than the gaps between them. Without, what
    agrees to one part in `RESOLUTION` of the range is one level.
    """
    rising = np.sort(x)
    span = float(rising[-1] - rising[0]) if len(x) else 0.0
    if span <= 1e-9 * float(np.abs(x).max(initial=0.0)):
        return rising[:1]
    wide = np.flatnonzero(np.diff(rising) > APART * span)
    heaps = np.split(rising, wide + 1)
    gaps = np.diff(rising)[wide]
    if len(gaps) and max(float(np.ptp(heap)) for heap in heaps) < 0.5 * float(gaps.min()):
        return np.array([heap.mean() for heap in heaps])
    _, which = np.unique(np.round((rising - rising[0]) / span * RESOLUTION), return_inverse=True)
    return np.asarray(np.bincount(which, rising) / np.bincount(which))


def _none(x: Array) -> Array:
    return np.zeros((1, 0))


def _scales(x: Array) -> Array:
    return np.geomspace(0.03, 3.0, SCALES)[:, None] * float(np.abs(x).max())


def _periods(x: Array) -> Array:
    span = float(np.ptp(x))
    most = min(MOST_CYCLES, len(levels(x)) / 3.0)
    cycles = np.arange(0.5, max(most, 0.75), 0.25)
    return np.asarray(span / cycles[:, None])


def _places(x: Array) -> Array:
    """Middles between neighbouring levels."""
    at = levels(np.abs(x))
    return np.asarray(0.5 * (at[1:] + at[:-1])[:, None])


def _peaks(x: Array) -> Array:
    low, high = float(np.abs(x).min()), float(np.abs(x).max())
    places = np.linspace(low, high, 14)[1:-1]
    return np.array(list(product(places, np.geomspace(0.04, 0.6, 5) * max(high - low, 1e-12))))


def _power(exponent: Fraction) -> Atom:
    p = float(exponent)
    branch = "{m}" if exponent == 1 else f"{{m}}**{exponent}" if exponent.denominator == 1 else f"{{m}}**({exponent})"
    return Atom(f"power {exponent}", (branch,), (), lambda x: (np.abs(x) ** p,), _none, exponent)


def _swing(x: Array, period: Array) -> tuple[Array, ...]:
    turns = REVOLUTION * x / period
    return np.cos(turns), np.sin(turns)


ONE = Atom("constant", ("1",), (), lambda x: (np.ones_like(x),), _none)
SIGN = Atom("sign", ("sign({x})",), (), lambda x: (np.sign(x),), _none)
DECAY = Atom("decay", ("exp(-{m}/{0})",), ("s",), lambda x, s: (np.exp(-np.abs(x) / s),), _scales)
SATURATION = Atom(
    "saturation",
    ("{m}/(1 + {m}/{0})",),
    ("s",),
    lambda x, s: (np.abs(x) / (1.0 + np.abs(x) / s),),
    _scales,
    Fraction(1),
)
SWING = Atom("swing", ("cos(2*pi*{x}/{0})", "sin(2*pi*{x}/{0})"), ("P",), _swing, _periods)
STEP = Atom(
    "step", ("Heaviside({m} - {0})",), ("p",), lambda x, p: (np.heaviside(np.abs(x) - p, 0.5),), _places, searched=False
)
PEAK = Atom(
    "peak",
    ("1/(1 + (({m} - {0})/{1})**2)",),
    ("p", "s"),
    lambda x, p, s: (1.0 / (1.0 + ((np.abs(x) - p) / s) ** 2),),
    _peaks,
)
PLAIN = tuple(_power(exponent) for exponent in POWERS)
ATOMS = (*PLAIN, SIGN, DECAY, SATURATION, SWING, STEP, PEAK)
"""Every factor but the constant."""
