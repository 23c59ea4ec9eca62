"""Stretches of a recording between changes of speed or torque, where nothing marks the test points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    from pmg.pipeline.windows.limits import Steadiness
    from pmg.sim.signals import Array

BINS_BESIDE = 10
"""Bins into which the stretch on either side of a place is cut; places are looked at bin by bin."""
SLOWEST_TURN = 30.0
"""Longest turn of a shaft that torques are averaged over [s]: 2 rpm. Slower ones count as held."""


def plateaus(
    torques: Sequence[tuple[Array, float]], angles: Sequence[Array], rate_hz: float, limits: Steadiness
) -> tuple[tuple[int, int], ...]:
    """First sample and the one after the last of every plateau, in order.

    Parameters
    ----------
    torques : sequence of ((n,) array, float)
        Torque [N m] and nominal torque [N m] of each transducer.
    angles : sequence of (n,) array
        Angle of each shaft [rad].
    rate_hz : float
        Sample rate [Hz].
    limits : Steadiness
        How large a change is, and how long it takes to settle.

    Notes
    -----
    At the border between two bins, the means over ``step_beside`` before and after it are compared. Where a speed
    differs by more than ``step_speed`` or a torque by more than ``step_torque``, or a signal is missing on either side
    over all that time, the set-points are changing. Where a shaft needs longer than that for a turn, torques are
    compared over one turn of it, lest its ripple pass for a change; less than a turn from either end of the record no
    change of torque is looked for then. A plateau lasts from ``settle`` after the last such border to the
    next one, whole: its borders follow from the size of the changes alone, never from how steady or how quiet it is.
    A change that is slower than the limits stands inside a plateau, and speaks against it when it is judged.
    """
    size = max(1, round(limits.step_beside * rate_hz / BINS_BESIDE))
    n = len(angles[0])
    count = n // size
    if count < 2 * BINS_BESIDE:
        return ((0, n),) if n else ()
    moving = np.zeros(count - 2 * BINS_BESIDE + 1, dtype=bool)
    turn = np.zeros(len(moving))
    for angle in angles:
        step = np.diff(angle, append=np.nan) * rate_hz
        before, after = _beside(_sums(step, size, count))
        moving |= ~(np.abs(after - before) <= limits.step_speed)
        turn = np.fmax(turn, _turn(before, after))
    span = np.maximum(np.rint(turn * rate_hz).astype(np.int64), BINS_BESIDE * size)
    places = (np.arange(len(moving)) + BINS_BESIDE) * size
    for torque, nominal in torques:
        before, after = _beside(_sums(torque, size, count))
        slow = span > BINS_BESIDE * size
        change = np.where(slow, _over_turns(torque, places, span), np.abs(after - before))
        moving |= ~(change <= limits.step_torque * nominal) | np.isnan(after - before)
    borders = (np.flatnonzero(moving) + BINS_BESIDE) * size
    settle = round(limits.settle * rate_hz)
    starts, stops = np.r_[0, borders + settle], np.r_[borders, n]
    return tuple((int(a), int(b)) for a, b in zip(starts, stops, strict=True) if b > a)


def _sums(values: Array, size: int, count: int) -> tuple[Array, Array]:
    """Sum of what is known in each bin, and how many values that is (count,)."""
    bins = values[: size * count].reshape(count, size)
    known = np.isfinite(bins)
    return np.where(known, bins, 0.0).sum(axis=1), known.sum(axis=1).astype(np.float64)


def _beside(bins: tuple[Array, Array]) -> tuple[Array, Array]:
    """Means before and after each border with a full stretch on both sides; NaN where nothing is known."""
    total, known = (np.convolve(part, np.ones(BINS_BESIDE), "valid") for part in bins)
    with np.errstate(invalid="ignore", divide="ignore"):
        means = total / known
    return means[:-BINS_BESIDE], means[BINS_BESIDE:]


def _turn(before: Array, after: Array) -> Array:
    """Time of one turn [s] at the mean of two speeds [rad/s]; 0 where the shaft is held or its speed not known."""
    with np.errstate(divide="ignore"):
        turn = REVOLUTION / np.abs(0.5 * (before + after))
    return np.where(turn <= SLOWEST_TURN, turn, 0.0)


def _over_turns(torque: Array, places: npt.NDArray[np.int64], span: npt.NDArray[np.int64]) -> Array:
    """Difference of the means over so many samples after and before each place; 0 where the record is too short."""
    known = np.isfinite(torque)
    total = np.concatenate(([0.0], np.cumsum(np.where(known, torque, 0.0))))
    count = np.concatenate(([0], np.cumsum(known)))
    low, high = np.maximum(places - span, 0), np.minimum(places + span, len(torque))
    with np.errstate(invalid="ignore", divide="ignore"):
        before = (total[places] - total[low]) / (count[places] - count[low])
        after = (total[high] - total[places]) / (count[high] - count[places])
    return np.where(high - low == 2 * span, np.abs(after - before), 0.0)
