"""Samples that lie between rows, counted from their times: jitter evens out, lost samples and pauses stay."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import median_filter

from pmg.pipeline.importers.rows import UNEVEN

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.sim.signals import Array, Mask

LONGEST_FILLED = 5
"""Longest step that counts as missing samples [samples]; a longer one is a pause."""

HALF_WINDOWS = (12, 50, 200)
"""Rows on either side of the middle of windows whose medians tell lost samples from jitter; the first that can."""

PASSES = 6
"""Most times that lost samples are searched for; each finds those that others hid."""

LEAST_SHIFT = 0.6
"""Samples by which times must stay behind after a step for samples to be missing."""

COARSE_RATE = 0.375
"""Standard error of a rate from coarse times, over their resolution and the length; the most is four times that."""

SPAN_OF_RATE = 1000
"""Rows over which a rate is taken where single steps scatter."""


SEARCHED_FOR_TICKS = 200_000
"""Rows from whose times the resolution of the clock is found."""

MOST_TICKS = 50
"""Most different steps in a time column that shows its resolution."""


@dataclass(frozen=True)
class SampleCount:
    """Places of rows on an even clock.

    Parameters
    ----------
    rate_hz : float
        By the time column, pauses left out [Hz].
    error : float
        Standard error of it as a part [1].
    steps : (n - 1,) array of int
        Samples from row to row; of no meaning at breaks.
    breaks : (n - 1,) array of bool
        Steps that are pauses.
    jitter : (n,) array
        Time of each row less its even place in its stretch [samples].
    packet : float
        Rows that share a time, at the mean [1].
    """

    rate_hz: float
    error: float
    steps: npt.NDArray[np.int64]
    breaks: Mask
    jitter: Array
    packet: float


def count_samples(time: Array) -> SampleCount:
    """The count of samples between rows, from times alone.

    Parameters
    ----------
    time : (n,) array
        Mostly growing, two or more, not all the same [s].

    Notes
    -----
    Where all steps are near whole numbers of samples, these are the count. Where they scatter, a step counts as a loss
    only if the times stay behind after it: the medians of windows before and after it differ by a sample or more,
    and by five times the scatter of such differences.
    """
    rate = _first_rate(time)
    packet = len(time) / max(int((np.diff(time) * rate > 0.05).sum()) + 1, 1)
    for _ in range(2):
        steps, breaks = _counted_steps(time * rate, packet)
        before, (rate, error, jitter) = rate, _line(time, steps, breaks, rate)
        if abs(rate / before - 1.0) < 1e-6:
            break
    tick = resolution_of(time) * rate
    if 2.0 * float(np.abs(jitter).max()) > 0.25 * tick:
        error = max(error, COARSE_RATE * tick / len(time))
    return SampleCount(rate, error, steps, breaks, jitter, packet)


def resolution_of(time: Array) -> float:
    """Distance of the values that times can take [s]; that of the numbers themselves where steps show none.

    Parameters
    ----------
    time : (n,) array
        Two or more [s].
    """
    part = time[:SEARCHED_FOR_TICKS]
    spacing = float(np.spacing(np.abs(part).max()))
    fine = 8.0 * spacing
    steps = np.sort(np.diff(part))
    first = np.flatnonzero(np.diff(steps, prepend=-np.inf) > fine)
    if not 2 <= len(first) <= MOST_TICKS:
        return spacing
    return float(np.diff(steps[first]).min())


def _first_rate(time: Array) -> float:
    """Rate by the median step, over many rows where steps scatter [Hz]."""
    steps = np.diff(time)
    step = float(np.median(steps))
    if step > 0.0 and float((np.abs(steps - step) < 0.1 * step).mean()) > 0.5:
        return 1.0 / step
    span = max(min(SPAN_OF_RATE, len(steps) // 4), 1)
    long = float(np.median(time[span:] - time[:-span]))
    return span / long if long > 0.0 else len(steps) / float(np.ptp(time))


def _counted_steps(places: Array, packet: float) -> tuple[npt.NDArray[np.int64], Mask]:
    """Samples from row to row (n - 1,), and which steps are pauses, from times in samples (n,)."""
    steps = np.diff(places)
    whole = np.rint(steps)
    pauses = steps > LONGEST_FILLED + 0.5
    if not (((np.abs(steps - whole) > UNEVEN) | (whole < 1.0)) & ~pauses).any():
        return whole.astype(np.int64), pauses
    excess = np.zeros(len(steps))
    late = places - np.arange(len(places))
    for _ in range(PASSES):
        found, size = _losses(late, steps - excess, packet)
        if not len(found):
            break
        excess[found] += size
        behind = np.zeros(len(steps))
        behind[found] = size
        late -= np.concatenate(([0.0], np.cumsum(behind)))
    whole = np.rint(excess + 1.0)
    return whole.astype(np.int64), whole > LONGEST_FILLED + (0.0 if packet < 2.0 else packet)


def _losses(late: Array, steps: Array, packet: float) -> tuple[npt.NDArray[np.int64], Array]:
    """Steps after which the times stay behind, and by how many samples."""
    last = len(late) - 1
    row = np.arange(last)
    long = np.flatnonzero(steps > 1.5)
    for half in HALF_WINDOWS:
        half = int(half * np.ceil(packet))
        if 2 * half > last:
            break
        level = median_filter(late, 2 * half + 1, mode="nearest")
        shift = level[np.minimum(row + 1 + half, last)] - level[np.maximum(row - half, 0)]
        scatter = 1.4826 * float(np.median(np.abs(shift - np.median(shift))))
        if 5.0 * scatter > LEAST_SHIFT * packet:
            pauses = long[(shift[long] > LONGEST_FILLED * packet) & (shift[long] > 10.0 * scatter)]
            if not len(pauses):
                continue
            long = pauses
        long = long[shift[long] > LEAST_SHIFT * packet]
        if not len(long):
            return long, np.zeros(0)
        group = np.cumsum(np.diff(long, prepend=long[0]) > 2 * half)
        order = np.lexsort((-steps[long], group))
        chosen = long[order[np.unique(group[order], return_index=True)[1]]]
        size = shift[chosen]
        size = np.where(size > LONGEST_FILLED, size, np.rint(size))
        return chosen, size
    return np.zeros(0, dtype=np.int64), np.zeros(0)


def _line(time: Array, steps: npt.NDArray[np.int64], breaks: Mask, rate: float) -> tuple[float, float, Array]:
    """Rate [Hz], its standard error as a part, and what is left of each row's time [samples], stretch by stretch."""
    index = np.concatenate(([0], np.cumsum(np.where(breaks, 0, steps)))).astype(np.float64)
    stretch = np.concatenate(([0], np.cumsum(breaks)))
    rows = np.bincount(stretch)
    first = np.concatenate(([0], np.cumsum(rows)[:-1]))
    at = time - time[first][stretch]
    index -= (np.bincount(stretch, index) / rows)[stretch]
    at -= (np.bincount(stretch, at) / rows)[stretch]
    size = float(index @ index)
    if size == 0.0 or not float(index @ at) > 0.0:
        return rate, float("inf"), at * rate - index
    period = float(index @ at) / size
    jitter = at / period - index
    return 1.0 / period, float(np.sqrt(np.mean(jitter**2) / size)), jitter
