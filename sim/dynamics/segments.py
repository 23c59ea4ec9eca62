"""Stretches of a run on which both programmes are one formula: what a solver integrates over without a break."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from pmg.sim.dynamics.programme import Programme
    from pmg.sim.signals import Array

ROW = ("begin", "value", "slope", "amplitude", "angle", "frequency", "half_chirp")
"""Numbers of one leg of one motor."""


class Legs(NamedTuple):
    """Legs of a run.

    `ends` (n,) are their ends [s]; `rows` (n, 2, 7) hold for sun and ring the numbers of `ROW`.
    """

    ends: Array
    rows: Array


def follow(row: Array, time: float) -> tuple[float, float, float]:
    """Set value on a leg at a time, its rate and the rate of that.

    Compiled with the fast solver and called by the reference: plain arithmetic.
    """
    dt = time - row[0]
    angle = row[4] + (row[5] + row[6] * dt) * dt
    rate = row[5] + 2.0 * row[6] * dt
    sine, cosine = math.sin(angle), math.cos(angle)
    value = row[1] + row[2] * dt + row[3] * sine
    slope = row[2] + row[3] * rate * cosine
    return value, slope, row[3] * (2.0 * row[6] * cosine - rate * rate * sine)


def make_legs(sun: Programme, ring: Programme, duration: float) -> Legs:
    """Legs of two programmes from time 0."""
    corners = np.concatenate((sun.corners, ring.corners))
    inner = corners[(corners > 0.0) & (corners < duration)]
    edges = np.unique(np.concatenate(([0.0, duration], inner)))
    begins = edges[:-1]
    rows = np.zeros((begins.size, 2, len(ROW)))
    for side, programme in enumerate((sun, ring)):
        plain = rows[:, side]
        slopes = np.concatenate(([0.0], np.diff(programme.values) / np.diff(programme.times), [0.0]))
        plain[:, 0] = begins
        plain[:, 1] = np.interp(begins, programme.times, programme.values)
        plain[:, 2] = slopes[np.searchsorted(programme.times, begins, side="right")]
        for sweep in programme.sweeps:
            inside = (begins >= sweep.begin) & (begins < sweep.end)
            angle, rate = sweep.angle(begins[inside])
            chirp = (sweep.frequency_end - sweep.frequency_begin) / (sweep.end - sweep.begin)
            plain[inside, 3] = sweep.amplitude
            plain[inside, 4], plain[inside, 5], plain[inside, 6] = angle, rate, 0.5 * chirp
    return Legs(edges[1:], rows)
