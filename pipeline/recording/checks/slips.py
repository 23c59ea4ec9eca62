"""Slips of an encoder's count, from where the index pulses stand in the turn."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt

    Floats = npt.NDArray[np.float64]

TOLERANCE = 1.0
"""Counts to either side by which a latch may be off, besides those of the sample in which it falls."""


def find_slips(place: Floats, speed: Floats) -> list[tuple[int, int, float]]:
    """Slips as pulse before, pulse after, and counts.

    Parameters
    ----------
    place : (n,) array
        Count at each pulse less whole turns [counts].
    speed : (n,) array
        Speed there [counts per sample].

    Notes
    -----
    Recorders latch the count up to one sample after the index, or up to one before it, and do not say which; what tells
    fewer slips is taken. After it, the index stands between `place` - `speed` and `place` (the other way round when
    turning back), widened by `TOLERANCE`. While the count is kept, one place lies in
    all these intervals; as soon as none does, a slip lies between the last pulses that agree with the ones before it
    and the first that agree with the ones after it. The more pulses on either side, the smaller the slip that shows;
    a sound count never shows one. The size is the difference of the medians of both sides.
    """
    return min((_slips(place, behind) for behind in (speed, -speed)), key=len)


def _slips(place: Floats, behind: Floats) -> list[tuple[int, int, float]]:
    """Slips, where each latch is up to `behind` counts beyond the index."""
    low = place - np.maximum(behind, 0.0) - TOLERANCE
    high = place + np.maximum(-behind, 0.0) + TOLERANCE
    found: list[tuple[int, int]] = []
    start, least, most = 0, -np.inf, np.inf
    for k in range(len(place)):
        least, most = max(least, float(low[k])), min(most, float(high[k]))
        if least > most:
            start, least, most = _agreeing(low, high, k)
            found.append((start - 1, k))
    steps = np.abs(np.diff(place))
    borders: list[int] = []
    for before, after in found:
        earliest = max(before, borders[-1] if borders else 0)
        borders.append(earliest + 1 + int(np.argmax(steps[earliest:after])))
    parts = pairwise([0, *borders, len(place)])
    sizes = np.diff([float(np.median(place[low_end:high_end])) for low_end, high_end in parts])
    return [(before, after, float(size)) for (before, after), size in zip(found, sizes, strict=True)]


def _agreeing(low: Floats, high: Floats, k: int) -> tuple[int, float, float]:
    """First pulse from which on all up to `k` agree, and the ends of the interval in which they do."""
    least, most = float(low[k]), float(high[k])
    while k > 0:
        wider = max(least, float(low[k - 1])), min(most, float(high[k - 1]))
        if wider[0] > wider[1]:
            break
        least, most = wider
        k -= 1
    return k, least, most
