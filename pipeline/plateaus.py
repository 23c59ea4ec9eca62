"""Stretches of a recording between changes of speed or torque, where nothing marks the test points."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pmg.pipeline.limits import Steadiness
    from pmg.sim.signals import Array, Mask

BINS_BESIDE = 10
"""Bins into which the stretch on either side of a place is cut; places are looked at bin by bin."""


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
    over all that time, the set-points are changing. A plateau lasts from ``settle`` after the last such border to the
    next one, whole: its borders follow from the size of the changes alone, never from how steady or how quiet it is.
    A change that is slower than the limits stands inside a plateau, and speaks against it when it is judged.
    """
    size = max(1, round(limits.step_beside * rate_hz / BINS_BESIDE))
    n = len(angles[0])
    count = n // size
    if count < 2 * BINS_BESIDE:
        return ((0, n),) if n else ()
    moving = np.zeros(count - 2 * BINS_BESIDE + 1, dtype=bool)
    for torque, nominal in torques:
        moving |= _changes(_sums(torque, size, count), limits.step_torque * nominal)
    for angle in angles:
        step = np.diff(angle, append=np.nan) * rate_hz
        moving |= _changes(_sums(step, size, count), limits.step_speed)
    borders = (np.flatnonzero(moving) + BINS_BESIDE) * size
    settle = round(limits.settle * rate_hz)
    starts, stops = np.r_[0, borders + settle], np.r_[borders, n]
    return tuple((int(a), int(b)) for a, b in zip(starts, stops, strict=True) if b > a)


def _sums(values: Array, size: int, count: int) -> tuple[Array, Array]:
    """Sum of what is known in each bin, and how many values that is (count,)."""
    bins = values[: size * count].reshape(count, size)
    known = np.isfinite(bins)
    return np.where(known, bins, 0.0).sum(axis=1), known.sum(axis=1).astype(np.float64)


def _changes(bins: tuple[Array, Array], limit: float) -> Mask:
    """Whether the means beside each border with a full stretch on both sides differ by more than the limit."""
    total, known = (np.convolve(part, np.ones(BINS_BESIDE), "valid") for part in bins)
    before, after = slice(None, -BINS_BESIDE), slice(BINS_BESIDE, None)
    with np.errstate(invalid="ignore", divide="ignore"):
        means = total / known
        same = np.abs(means[after] - means[before]) <= limit
    return np.asarray(~same)
