"""A signal that two recordings hold in common: on one sample rate, and the shifts at which they are most alike."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.interpolate import make_interp_spline
from scipy.signal import butter, find_peaks, sosfiltfilt
from scipy.stats import norm

from pmg.sim.errors import RecordingError

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.sim.signals import Array, Mask

FEWEST_COMMON = 64
"""Fewest samples of each recording; below, no correlation is told from chance."""

MOST_COMMON = 1_000_000
"""Most samples of the longer recording that are compared; of longer ones the rate is lowered."""

UNEVEN_STEP = 0.02
"""Part by which the steps of an even recording may differ."""

CHANCE = 1e-3
"""Probability with which two recordings that have nothing in common may pass."""

HARDLY_CHANCE = 0.02
"""Part of the power that is left below which two signals are alike, however few independent samples they have."""

LOBE = 0.7
"""Part of the highest correlation down to which its peak reaches."""

SURE_OF_PEAK = 5.0
"""Logarithm of the odds by which the highest peak must stand above another for that one to be ruled out."""

SAME_REST = 1e-3
"""Part of the power that may be left at any peak without telling it from another."""

MOST_OTHERS = 20
"""Most other peaks that are named."""


@dataclass(frozen=True)
class CommonSignal:
    """Two recordings of one signal, ready to be compared.

    Parameters
    ----------
    first_time, first : (n,) array
        Times [s] of the first, on its own rate, and its values.
    second_time, second : (m,) array
        Times [s] of the second, on the common rate, and its values.
    rate_hz : float
        The lower of the two rates, which is the common one [Hz].
    where : str
        The two recordings, for errors.
    """

    first_time: Array
    first: Array
    second_time: Array
    second: Array
    rate_hz: float
    where: str

    def overlap(self, offset: float) -> Mask:
        """Samples of the second (m,) that the first covers at an offset [s]."""
        low, high = float(self.first_time[0]), float(self.first_time[-1])
        return (self.second_time + offset >= low) & (self.second_time + offset <= high)


@dataclass(frozen=True)
class Peaks:
    """Offsets at which two recordings are most alike.

    Parameters
    ----------
    offset : float
        Of the highest correlation [s].
    margin : float
        Size of that correlation less that of the next peak [1]; negative if that one has a shorter overlap.
    others : tuple of float
        Offsets of peaks that are not ruled out [s].
    """

    offset: float
    margin: float
    others: tuple[float, ...]


def common_signal(first: tuple[Array, Array], second: tuple[Array, Array], where: str) -> CommonSignal:
    """Two recordings brought to one rate.

    Parameters
    ----------
    first, second : pair of (n,) array
        Times [s] and values.
    where : str
        The two recordings, for errors.

    Raises
    ------
    RecordingError
        When one is too short, not finite, constant, or uneven.
    """
    rates, spans = [], []
    for name, (time, values) in (("first", first), ("second", second)):
        if len(time) != len(values) or len(time) < FEWEST_COMMON:
            came = f"the {name} recording has {len(time)} times and {len(values)} values"
            raise RecordingError(where, came, f"{FEWEST_COMMON} or more of each", "Choose a longer part.")
        steps = np.diff(time)
        step = float(np.mean(steps))
        if not (np.isfinite(values).all() and np.isfinite(time).all() and step > 0.0):
            came = f"the {name} recording has values that are no numbers, or times that do not grow"
            raise RecordingError(where, came, "numbers", "Mend or cut the recording.")
        if float(np.abs(steps - step).max()) > UNEVEN_STEP * step + 2.0 * float(np.spacing(np.abs(time).max())):
            do = "Place it on an even clock first, and choose one stretch of it."
            raise RecordingError(where, f"the {name} recording is sampled unevenly", "even sampling", do)
        if float(np.ptp(values)) == 0.0:
            do = "Choose a channel that changes."
            raise RecordingError(where, f"the {name} recording has the same value throughout", "a signal", do)
        rates.append(1.0 / step)
        spans.append(float(time[-1] - time[0]))
    rate = min(*rates, MOST_COMMON / max(spans))
    first_values, second_values = (
        _banded(np.asarray(values, dtype=np.float64), own, rate)
        for (_, values), own in zip((first, second), rates, strict=True)
    )
    time, values = np.asarray(second[0], dtype=np.float64), second_values
    if rates[1] > rate * (1.0 + 1e-9):
        grid = time[0] + np.arange(int(spans[1] * rate * (1.0 + 1e-12)) + 1) / rate
        values, time = np.asarray(make_interp_spline(time, values, k=5)(np.minimum(grid, time[-1]))), grid
    return CommonSignal(np.asarray(first[0], dtype=np.float64), first_values, time, values, rate, where)


def _banded(values: Array, own: float, rate: float) -> Array:
    """Values (n,) without what a lower rate cannot hold, and without their mean."""
    values = values - values.mean()
    if own < 1.1 * rate:
        return values
    sections = butter(8, 0.4 * rate, fs=own, output="sos")
    return np.asarray(sosfiltfilt(sections, values, padlen=min(len(values) - 1, int(10 * own / rate))))


def peaks_of(pair: CommonSignal, largest_s: float | None) -> Peaks:
    """The offsets at which the normalised correlation is highest, of either sign.

    Parameters
    ----------
    pair : CommonSignal
        Two recordings.
    largest_s : float, optional
        Largest size of the offset [s].

    Raises
    ------
    RecordingError
        When no offset is allowed, or the highest correlation is not beyond chance.

    Notes
    -----
    Of peaks that are next to equal, the one with the longer overlap counts. Chance is judged by Fisher's transform,
    with the degrees of freedom that the autocorrelations of the two leave (Bartlett), over as many shifts as are
    independent; signals that are next to equal pass with few of them.
    """
    count = int((pair.first_time[-1] - pair.first_time[0]) * pair.rate_hz * (1.0 + 1e-12)) + 1
    grid = np.minimum(pair.first_time[0] + np.arange(count) / pair.rate_hz, pair.first_time[-1])
    x = np.interp(grid, pair.first_time, pair.first)
    x, y = x - x.mean(), pair.second - pair.second.mean()
    lag, height, width = _correlated(x, y)
    offset = pair.first_time[0] - pair.second_time[0] + lag / pair.rate_hz
    allowed = np.ones(len(lag), dtype=bool) if largest_s is None else np.abs(offset) <= largest_s
    if not allowed.any():
        came, do = f"no overlap of half the shorter at offsets up to {largest_s:g} s", "Allow a larger offset."
        raise RecordingError(pair.where, came, "recordings of one time", do)
    size = np.where(allowed, np.abs(height), 0.0)
    overlap = np.minimum(len(x), lag + len(y)) - np.maximum(0, lag)
    left = 1.0 - np.minimum(size, 1.0) ** 2 + SAME_REST
    best = int(np.argmax(np.where(allowed, -overlap * np.log(left), -np.inf)))
    freedom = max(float(overlap[best]) / width, 1.0)
    shifts = max(float(allowed.sum()) / width, 1.0)
    score = float(np.arctanh(min(size[best], 1.0 - 1e-12))) * np.sqrt(max(freedom - 3.0, 0.5))
    if not (score > float(norm.isf(CHANCE / 2.0 / shifts)) or left[best] - SAME_REST < HARDLY_CHANCE):
        came = f"a correlation of {height[best]:+.2f} at most, which {freedom:.0f} independent samples reach by chance"
        do = "Choose a longer part, or a signal that changes more and follows the same thing in both."
        raise RecordingError(pair.where, came, "a correlation beyond chance", do)
    low, high = _lobe(size, best)
    rest = size.copy()
    rest[low : high + 1] = 0.0
    found = find_peaks(np.pad(rest, 1), prominence=0.1 * size[best])[0] - 1
    found = found[np.argsort(-rest[found], kind="stable")]
    possible = [k for k in found if 0.5 * freedom * np.log(left[k] / left[best]) < SURE_OF_PEAK]
    others = tuple(float(offset[k]) for k in possible[:MOST_OTHERS])
    margin = float(size[best] - (rest[found[0]] if len(found) else 0.0))
    return Peaks(float(offset[best]), margin, others)


def _correlated(x: Array, y: Array) -> tuple[npt.NDArray[np.int64], Array, float]:
    """Shifts [samples], the correlation at each [1], and the width of the autocorrelations [samples]."""
    length = next_fast_len(len(x) + len(y), real=True)
    fx, fy = rfft(x, length), rfft(y, length)
    lag = np.arange(-(len(y) - 1), len(x), dtype=np.int64)
    product = np.roll(irfft(fx * np.conj(fy), length), len(y) - 1)[: len(lag)]
    low, high = np.maximum(lag, 0), np.minimum(len(x), lag + len(y))
    enough = high - low >= min(len(x), len(y)) / 2.0
    lag, product, low, high = lag[enough], product[enough], low[enough], high[enough]
    number = high - low

    def sums(values: Array, first: Array, last: Array) -> Array:
        total = np.concatenate(([0.0], np.cumsum(values)))
        return np.asarray(total[last] - total[first])

    sum_x, sum_y = sums(x, low, high), sums(y, low - lag, high - lag)
    power_x = sums(x**2, low, high) - sum_x**2 / number
    power_y = sums(y**2, low - lag, high - lag) - sum_y**2 / number
    flat = (power_x < 1e-6 * number * x.var()) | (power_y < 1e-6 * number * y.var())
    scale = np.sqrt(np.where(flat, 1.0, power_x * power_y))
    height = np.where(flat, 0.0, (product - sum_x * sum_y / number) / scale)
    own_x, own_y = irfft(np.abs(fx) ** 2, length), irfft(np.abs(fy) ** 2, length)
    width = float(own_x @ own_y) / float(own_x[0] * own_y[0])
    return lag, np.asarray(height, dtype=np.float64), max(width, 1.0)


def _lobe(size: Array, best: int) -> tuple[int, int]:
    """First and last shift of the peak around the best one."""
    below = size < LOBE * size[best]
    left, right = np.flatnonzero(below[:best]), np.flatnonzero(below[best:])
    return int(left[-1]) + 1 if len(left) else 0, best + int(right[0]) - 1 if len(right) else len(size) - 1
