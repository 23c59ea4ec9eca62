"""Which lines are looked for in a signal, and which of them a window can tell apart."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.shafts import on_side
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from pmg.sim.bench import BenchParameters
    from pmg.sim.signals import Array

LOW_ORDERS = (1, 2, 3, 4, 6)
"""Orders of either shaft whatever the poles: unbalance, couplings, bearings, mounting."""
MULTIPLES = (1, 2, 3)
"""Multiples of the pole pairs that are looked for."""
FEWEST_CYCLES = 2.0
"""Cycles of a line in the window below which it cannot be distinguished from drift."""
APART = 1.0
"""Least distance of two lines in cycles of the window; nearer ones are one group."""
HIGHEST = 0.45
"""Highest frequency of a line, as part of the sample rate; a line above it is seen elsewhere or not at all."""


@dataclass(frozen=True)
class Line:
    r"""A line that follows the angles of the shafts.

    Parameters
    ----------
    order_sun, order_ring : int
        Periods in a turn of either shaft; its phase is :math:`m\theta_s + n\theta_r`.
    meaning : str
        What usually makes it.
    """

    order_sun: int
    order_ring: int
    meaning: str

    @property
    def name(self) -> str:
        """``sun 5``, ``ring 13``, or ``slip`` where both shafts take part."""
        if self.order_sun and self.order_ring:
            return "slip"
        return f"sun {self.order_sun}" if self.order_sun else f"ring {self.order_ring}"

    def phase(self, sun: Array, ring: Array) -> Array:
        """Phase at these angles [rad]."""
        return np.asarray(self.order_sun * sun + self.order_ring * ring)

    def speed(self, sun: float, ring: float) -> float:
        """Rate of the phase at these speeds of the shafts [rad/s]."""
        return self.order_sun * sun + self.order_ring * ring


@dataclass(frozen=True)
class Group:
    """Lines that a window cannot tell apart; fitted as the first of them.

    Parameters
    ----------
    lines : tuple of Line
        One, or several at one frequency.
    frequency : float
        Of the first [Hz].
    """

    lines: tuple[Line, ...]
    frequency: float

    @property
    def name(self) -> str:
        """Names of all, such as ``sun 5 = ring 13``."""
        return " = ".join(line.name for line in self.lines)


@dataclass(frozen=True)
class Unresolved:
    """A line of which a window gives no number, and why."""

    line: Line
    reason: str


def lines_of(bench: BenchParameters, gear: int) -> tuple[Line, ...]:
    """The lines that a stage may show.

    Parameters
    ----------
    bench : BenchParameters
        Pole pairs and iron poles.
    gear : int
        1 or 2.

    Notes
    -----
    Cogging of a rotor stands at the least common multiple of its magnets and the iron poles. Two poles of one rotor
    that pass an iron pole make the order of the iron poles. Pole slip, m = p_sun and n = p_ring, is at rest while
    the gear holds.
    """
    poles = int(bench.carrier.iron_poles)
    pairs = bench.gear(gear).pole_pairs
    found: list[Line] = []
    for side, p in pairs.items():
        meanings = dict.fromkeys(LOW_ORDERS, "mounting")
        meanings |= {1: "unbalance, eccentricity", 2: "coupling out of line"}
        meanings |= {k * p: f"pole pairs x {k}" if k > 1 else "pole pairs" for k in MULTIPLES}
        meanings |= {poles: "iron poles", 2 * poles: "iron poles x 2", math.lcm(2 * p, poles): "cogging"}
        for order, text in sorted(meanings.items()):
            orders = on_side(side, order, 0)
            found.append(Line(orders.sun, orders.ring, text))
    return (*found, Line(pairs.sun, pairs.ring, "pole slip"))


def resolve(
    lines: Sequence[Line], speeds: Mapping[str, float], duration: float, rate_hz: float
) -> tuple[tuple[Group, ...], tuple[Unresolved, ...]]:
    """Groups that a window can tell apart, and the lines of which it says nothing.

    Parameters
    ----------
    lines : sequence of Line
        Candidates.
    speeds : mapping of str to float
        Mean speed of ``sun`` and ``ring`` over the window [rad/s].
    duration : float
        Length of the window [s].
    rate_hz : float
        Sample rate [Hz].

    Notes
    -----
    Two lines less than `APART` cycles of the window apart are one group. Engaged, the poles lock both shafts, and
    pole-pair orders of the sun and the ring are one frequency whatever the length.
    """
    groups: list[Group] = []
    left: list[Unresolved] = []
    for line in lines:
        frequency = abs(line.speed(speeds["sun"], speeds["ring"])) / REVOLUTION
        cycles = frequency * duration
        if not math.isfinite(frequency):
            left.append(Unresolved(line, "no speed is known"))
        elif cycles < FEWEST_CYCLES:
            still = "at rest" if cycles < APART else f"only {cycles:.1f} cycles in the window"
            left.append(Unresolved(line, f"{still}; at least {FEWEST_CYCLES:g} are needed"))
        elif frequency > HIGHEST * rate_hz:
            limit = f"{HIGHEST * rate_hz:.0f} Hz that {rate_hz:g} samples/s can show"
            left.append(Unresolved(line, f"at {frequency:.0f} Hz, above the {limit}"))
        else:
            near = [g for g in groups if abs(g.frequency - frequency) * duration < APART]
            if near:
                place = groups.index(near[0])
                groups[place] = Group((*near[0].lines, line), near[0].frequency)
            else:
                groups.append(Group((line,), frequency))
    return tuple(groups), tuple(left)
