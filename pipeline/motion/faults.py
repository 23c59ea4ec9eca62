"""Faults of the signals of a run in motion: counters that stand still, angles that jump, torques that are clipped."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.recording.checks.stretches import stretches
from pmg.pipeline.recording.checks.transducers import LIVELY

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.sim.signals import Array, Mask

    Ranges = npt.NDArray[np.int64]

STUCK_S, STUCK_SAMPLES = 0.02, 10
"""Least time [s] and samples for which a counter stands still."""
BESIDE_S, BESIDE_SAMPLES = 0.005, 3
"""Time [s] and samples next to a still stretch over which the speed is taken."""
SUDDEN = 3.5
"""Speed next to a still stretch [rad/s] that no shaft gains or loses between two samples."""
SUDDEN_COUNTS = 3.0
"""The same in counts over the samples next to it."""
HARDEST = 300.0
"""Acceleration of a shaft [rad/s^2] that hardly a run holds for long."""
LEAP = 0.1
"""Angle [rad] by which the count may be off what the speeds next to a sample let expect."""
SLOPE_SAMPLES = 10
"""Samples over which these speeds are taken."""
FLAT_S, FLAT_SAMPLES = 0.005, 5
"""Least time [s] and samples of one extreme value, to the bit, that make a clipped torque."""


def still(angle: Array, rate: float, count: float) -> Ranges:
    """Stretches (k, 2) in which a counter stands still though the shaft moves right before or after.

    Parameters
    ----------
    angle : (n,) array
        Angle of a shaft [rad]; NaN where it is not known.
    rate : float
        Sample rate [Hz].
    count : float
        Angle of one count [rad].
    """
    beside = max(BESIDE_SAMPLES, round(BESIDE_S * rate))
    fast = max(SUDDEN * beside / rate, SUDDEN_COUNTS * count)
    found = stretches(np.diff(angle) == 0.0) + np.array([0, 1])
    found = found[found[:, 1] - found[:, 0] > max(STUCK_SAMPLES, round(STUCK_S * rate))]

    def sudden(low: int, high: int) -> bool:
        return low >= 0 and high < len(angle) and abs(angle[high] - angle[low]) > fast

    rows = [
        (start, stop)
        for start, stop in found.tolist()
        if sudden(start - beside, start) or sudden(stop - 1, stop - 1 + beside)
    ]
    return np.array(rows, dtype=np.int64).reshape(-1, 2)


def leaps(angle: Array, rate: float) -> npt.NDArray[np.int64]:
    """Samples (k,) before which the angle jumps, next to what the speeds on either side let expect.

    Parameters
    ----------
    angle : (n,) array
        Angle of a shaft [rad]; NaN where it is not known.
    rate : float
        Sample rate [Hz].
    """
    place = np.flatnonzero(np.isfinite(angle))
    if len(place) < 2 * SLOPE_SAMPLES + 2:
        return np.empty(0, dtype=np.int64)
    known, time = angle[place], place / rate
    slope = (known[SLOPE_SAMPLES:] - known[:-SLOPE_SAMPLES]) / (time[SLOPE_SAMPLES:] - time[:-SLOPE_SAMPLES])
    step, lapse = np.diff(known), np.diff(time)
    inner = slice(SLOPE_SAMPLES, len(step) - SLOPE_SAMPLES)
    before, after = slope[: -SLOPE_SAMPLES - 1], slope[SLOPE_SAMPLES + 1 :]
    off = np.abs(step[inner] - 0.5 * (before + after) * lapse[inner])
    found = off > LEAP + 0.25 * HARDEST * lapse[inner] ** 2  # the most by which full throttle both ways is off
    return np.asarray(place[1:][inner][found])


def clipped(torque: Array, rate: float) -> Ranges:
    """Stretches (k, 2) in which a lively torque stands at its largest or smallest value to the bit.

    Parameters
    ----------
    torque : (n,) array
        Torque of a shaft [N m]; NaN where it is not known.
    rate : float
        Sample rate [Hz].
    """
    sound = np.isfinite(torque)
    if np.count_nonzero(sound) < 2:
        return np.empty((0, 2), dtype=np.int64)
    at_end = (torque == torque[sound].min()) | (torque == torque[sound].max())
    steps = np.diff(torque)
    beside = np.isfinite(steps) & ~(at_end[1:] & at_end[:-1])
    if not beside.any() or float(np.mean(steps[beside] != 0.0)) < LIVELY:
        return np.empty((0, 2), dtype=np.int64)
    found = stretches(at_end)
    return np.asarray(found[found[:, 1] - found[:, 0] >= max(FLAT_SAMPLES, round(FLAT_S * rate))])


def longest_piece(length: int, cuts: npt.NDArray[np.int64]) -> Mask:
    """The longest piece (n,) between some cuts, the first of those that are as long."""
    borders = np.concatenate(([0], np.sort(cuts), [length]))
    longest = int(np.argmax(np.diff(borders)))
    kept = np.zeros(length, dtype=np.bool_)
    kept[borders[longest] : borders[longest + 1]] = True
    return kept
