"""Faults of the signals of a run in motion: counters that stand still, angles that jump, torques that clip or spike."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import median_filter

from pmg.pipeline.recording.checks.stretches import stretches
from pmg.pipeline.recording.checks.transducers import LIVELY
from pmg.sim.signals import NORMAL_MAD

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
SPIKE_S, SPIKE_SAMPLES = 0.003, 3
"""Longest time [s] and samples of a spike."""
SPIKE_NOISE, USUAL_S = 8.0, 0.1
"""How far it stands out, in standard deviations of the readings over that time [s] around it; and farther than they
change from before it to after, so that a step is no spike."""
SLOPE_S, SPIKE_RATE = 0.01, 500.0
"""Time over which the speed is measured before and after a spike [s]; lowest sample rate at which one is found [Hz]."""
UNFELT = 0.15
"""Part of the change of speed that its impulse would make, of which the motor must show less. An impact that is over
within one sample may show a quarter."""
SEEN_COUNTS = 9.0
"""That change of speed, in counts over `SLOPE_S`, from which on an encoder would show so small a part of it."""


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


def spikes(torque: Array, angle: Array, rate: float, inertia: float, count: float) -> Ranges:
    r"""Stretches (k, 2) in which a torque stands out for an instant and the motor does not feel it.

    Parameters
    ----------
    torque, angle : (n,) array
        Torque [N m] and angle [rad] of a shaft that turns; NaN where it is not known.
    rate : float
        Sample rate [Hz].
    inertia : float
        Of the motor, on whose side of the transducer the encoder sits [kg m2].
    count : float
        Angle of one count [rad].

    Notes
    -----
    An impact, as where play closes, is as short, but its impulse changes the speed of the motor,
    :math:`J\,\Delta\omega = -\int T\,dt`. One of which less than `UNFELT` shows is no torque of the shaft. Where the
    encoder could not show it, nothing is said. Two real torques are as little felt: an impact whose change of speed a
    drive undoes within `SLOPE_S`, and a pulse of the motor itself against a far heavier rotor.
    """
    found, off = _stand_outs(np.where(np.isfinite(angle), torque, np.nan), rate)
    longest, slope = _lengths(rate)
    whole = np.concatenate([[0.0], np.cumsum(off)])
    slower = np.abs(whole[found[:, 1]] - whole[found[:, 0]]) / (rate * inertia)
    middle, reach = found.mean(axis=1).astype(np.int64), longest + slope

    def change(place: npt.NDArray[np.int64]) -> Array:
        begin, before, after, end = angle[place[:, None] + np.array([-reach, -longest, longest, reach])].T
        return np.asarray((end - after - before + begin) * rate / slope)

    felt = change(middle) - 0.5 * (change(middle - 2 * reach) + change(middle + 2 * reach))
    seen = slower > SEEN_COUNTS * count * rate / slope
    return np.asarray(found[seen & (np.abs(felt) < UNFELT * slower)])


def stand_outs(torque: Array, rate: float) -> Ranges:
    """Stretches (k, 2), each alone, in which a torque (n,) [N m] stands out for an instant; of a shaft at rest, spikes.

    Pulses in quick succession, as of play that rattles, and pulses beside unknown samples are not taken for spikes.
    """
    return _stand_outs(torque, rate)[0]


def _stand_outs(torque: Array, rate: float) -> tuple[Ranges, Array]:
    """The same, and how far each sample is off the readings before and after it (n,) [N m]."""
    known, (longest, slope) = np.isfinite(torque), _lengths(rate)
    n, alone, aside = len(torque), 3 * (longest + slope), longest // 2
    if rate < SPIKE_RATE or n < 3 * alone or np.count_nonzero(known) < n / 2:
        return np.empty((0, 2), dtype=np.int64), np.zeros(n)
    readings = np.interp(np.arange(n), np.flatnonzero(known), torque[known])
    level = np.pad(median_filter(readings, 2 * aside + 1), longest + aside, mode="edge")
    before, after = level[:n], level[-n:]
    off = readings - 0.5 * (before + after)
    steps = np.abs(np.diff(torque))
    step = float(np.min(steps, where=steps > 0.0, initial=np.inf))
    usual = median_filter(np.abs(off), 2 * round(0.5 * USUAL_S * rate) + 1, mode="nearest")
    noise = np.maximum(NORMAL_MAD * usual, step)
    found = stretches(np.abs(off) > np.maximum(SPIKE_NOISE * noise, np.abs(after - before)))
    lonely = np.diff(found.mean(axis=1), prepend=-n, append=2 * n) > alone
    unknown = np.concatenate([[0], np.cumsum(~known)])
    first, stop = np.maximum(found[:, 0] - alone, 0), np.minimum(found[:, 1] + alone, n)
    inner = (found[:, 0] >= alone) & (found[:, 1] <= n - alone) & (unknown[first] == unknown[stop])
    short = found[:, 1] - found[:, 0] <= longest
    return found[inner & lonely[1:] & lonely[:-1] & short], off


def _lengths(rate: float) -> tuple[int, int]:
    """Samples of the longest spike, and of the stretch over which a speed is taken beside it."""
    return max(SPIKE_SAMPLES, round(SPIKE_S * rate)), max(SLOPE_SAMPLES, round(SLOPE_S * rate))


def longest_piece(length: int, cuts: npt.NDArray[np.int64]) -> Mask:
    """The longest piece (n,) between some cuts, the first of those that are as long."""
    borders = np.concatenate(([0], np.sort(cuts), [length]))
    longest = int(np.argmax(np.diff(borders)))
    kept = np.zeros(length, dtype=np.bool_)
    kept[borders[longest] : borders[longest + 1]] = True
    return kept
