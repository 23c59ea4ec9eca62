"""Periods of position that a recording may show, as many as its length allows and memory bears."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.diagnosis.balance.records.recorded import Recorded
    from pmg.sim.signals import Array

PER_CYCLE = 3.0
"""Values of a period for each further cycle over the travel."""

MOST, MOST_VALUES = 1500, 1_200_000
"""Periods that are tabled at most, and samples of the regression times periods."""

PER_PERIOD, SLOW = 2.0, 0.1
"""Samples of the regression that a period must have, at the speed that this part of the moving samples stays below:
columns pass the same filter as the force, so that where the machine is faster a wave is in neither of them, and a tenth
of the samples tells a strong one."""

PER_BIN, MOST_BINS = 8.0, 2**22
"""Bins of position in the shortest period, and bins at most."""


def periods(recorded: Recorded, bounds: tuple[float, float]) -> Array:
    """Periods within bounds at which a force may be looked for, falling (g,); none where samples are too far apart.

    Notes
    -----
    Evenly spaced in orders, the inverse of a period. Where a long travel has more of them than are tabled, those are
    kept, octave by octave, at which what the baseline leaves is strongest over position: with their neighbours, by the
    spectrum of its means over bins of position.
    """
    motion = recorded.motion
    travel = float(np.ptp(motion.position))
    low = max(bounds[0], shortest(recorded), PER_BIN * PER_CYCLE * travel / MOST_BINS)
    high = bounds[1]
    if low >= high or travel <= 0.0:
        return np.zeros(0)
    count = max(2, int(PER_CYCLE * travel * (1.0 / low - 1.0 / high)))
    kept = min(MOST, max(MOST_VALUES // max(len(recorded.force), 1), 2))
    orders = np.linspace(1.0 / high, 1.0 / low, count)
    return np.asarray(1.0 / (orders if count <= kept else orders[_strongest(recorded, orders, low, kept)]))


def shortest(recorded: Recorded) -> float:
    """Shortest period that the samples of the regression show [m, rad]; infinite where nothing moves."""
    motion = recorded.motion
    moving = np.abs(motion.speed[motion.direction != 0.0])
    if not len(moving):
        return math.inf
    return PER_PERIOD * float(np.quantile(moving, SLOW)) * motion.sample_time * recorded.keep_every


def _strongest(recorded: Recorded, orders: Array, low: float, kept: int) -> npt.NDArray[np.int64]:
    """Places (k,) of orders to keep: of each octave the peaks of the spectrum over position, and their neighbours."""
    motion = recorded.motion
    width, start = low / PER_BIN, float(motion.position.min())
    place = ((motion.position - start) / width).astype(np.int64)
    left = motion.force - motion.modelled
    length = int(PER_CYCLE * (int(place.max()) + 1))
    power = np.zeros(len(orders))
    for values in (left, motion.direction * left):  # a force at a place, and a friction
        means = np.bincount(place, values - values.mean()) / np.maximum(np.bincount(place), 1)
        spectrum = np.abs(np.fft.rfft(means, length)) ** 2
        power = np.maximum(power, np.interp(orders, np.fft.rfftfreq(length, width), spectrum))
    octave = np.floor(np.log2(orders / orders[0])).astype(np.int64)
    peak = np.r_[True, power[1:] >= power[:-1]] & np.r_[power[:-1] >= power[1:], True]
    each = max(kept // (3 * (int(octave.max()) + 1)), 1)
    peaks = (np.flatnonzero(peak & (octave == k)) for k in range(int(octave.max()) + 1))
    tops = np.concatenate([found[np.argsort(-power[found])[:each]] for found in peaks])
    tops = tops[np.argsort(-power[tops])[: max(kept // 3, 1)]]  # octaves may be more than memory bears
    near = (tops[:, None] + np.array([-1, 0, 1])).ravel()
    return np.unique(near[(near >= 0) & (near < len(orders))])
