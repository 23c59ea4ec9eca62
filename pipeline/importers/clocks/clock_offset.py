"""Offset between two recordings on separate clocks, by a signal that both hold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import irfft, rfft, rfftfreq
from scipy.interpolate import make_interp_spline
from scipy.signal import correlate
from scipy.signal.windows import tukey
from scipy.stats import theilslopes

from pmg.pipeline.importers.clocks.common_signal import common_signal, peaks_of
from pmg.sim.errors import RecordingError
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.importers.clocks.common_signal import CommonSignal
    from pmg.sim.signals import Array, Mask, Spectrum

HIGHEST_PART = 0.25
"""Highest frequency that takes part, over the sample rate [1]; splines are true up to there."""

FADED = 0.1
"""Part of the overlap over which its two ends fade, so that they do not spill over the spectrum."""

FEWEST_LINES, PART_OF_LINES = 20, 0.3
"""Half the width over which spectra are smoothed: so many lines, or this part of the frequency."""

CERTAIN = 1.0 - 1e-6
"""Highest coherence that is told from one."""

INCOHERENT = 6.0
"""Coherence, over that of unrelated signals, below which a frequency takes no part."""

FOR_FEW = 4.0
"""Widening of the variance, over the number of lines that tell the offset: weights come from the same lines."""

ITERATIONS = 25
"""Most steps to the best offset."""

PARTS = 16
"""Parts of the overlap that show a drift before it is refined."""

FEWEST_IN_PART = 48
"""Fewest samples of such a part."""

LARGEST_DIFFERENCE = 2e-3
"""Part by which the rates of two clocks may differ."""


@dataclass(frozen=True)
class Offset:
    """The clock of one recording seen from that of another.

    A time :math:`t` of the second is :math:`t + o + d (t - t_0)` of the first.

    Parameters
    ----------
    offset : float
        What to add to the times of the second at `at` [s].
    offset_error : float
        Standard error of it [s].
    drift : float
        Rate difference: seconds by which the offset grows in a second of the second clock [1].
    drift_error : float
        Standard error of it [1].
    at : float
        Time of the second clock at which offset and drift are next to independent [s].
    correlation : float
        Reached by the two signals when aligned, with its sign [1].
    margin : float
        By how much its size exceeds that of the second-best peak [1]; negative if that one has a shorter overlap.
    others : tuple of float
        Other offsets that the data do not rule out, the likeliest first [s]; signals that repeat have some.
    """

    offset: float
    offset_error: float
    drift: float
    drift_error: float
    at: float
    correlation: float
    margin: float
    others: tuple[float, ...]


def offset_between(
    first: tuple[Array, Array],
    second: tuple[Array, Array],
    largest_s: float | None = None,
    where: str = "the two recordings",
) -> Offset:
    """The offset between the clocks of two recordings that hold a signal in common, up to a factor of either sign.

    Parameters
    ----------
    first, second : pair of (n,) array
        Times [s], evenly spaced, at any two rates, and values in any unit.
    largest_s : float, optional
        Largest size of the offset [s]; left out, any at which half of the shorter recording overlaps.
    where : str
        The two recordings, for errors.

    Raises
    ------
    RecordingError
        When a recording is too short, not finite or uneven, or when the correlation is not beyond chance.

    Notes
    -----
    The highest normalised correlation gives the offset to a sample. From there, offset and drift follow from the
    phases of the cross spectrum, weighted by :math:`\\gamma^2 / (1 - \\gamma^2)` of the coherence, which is the most
    that signals with stationary noise of any colour on both sides can tell. Standard errors are those of this
    estimate given the first signal, with the spectrum of what it leaves of the second; they hold for the peak that
    was chosen, not for `others`. Frequencies above a quarter of the lower rate are left out.

    References
    ----------
    C. H. Knapp, G. C. Carter, 'The generalized correlation method for estimation of time delay', IEEE Transactions on
    Acoustics, Speech, and Signal Processing 24 (1976) 320-327, doi:10.1109/TASSP.1976.1162830.
    """
    pair = common_signal(first, second, where)
    peaks = peaks_of(pair, largest_s)
    rows = pair.overlap(peaks.offset)
    time, here = pair.second_time[rows], pair.second[rows]
    spline = make_interp_spline(pair.first_time, pair.first, k=5)
    line = _begun(pair, _Line(peaks.offset, 0.0, float(time.mean())), rows, spline)
    covariance = np.full((2, 2), np.inf)
    for _ in range(ITERATIONS):
        step, covariance, middle = _step(_within(pair, spline, line, time), here, time, pair.rate_hz)
        reach = abs(step[0]) + abs(step[1]) * float(np.ptp(time)) / 2.0
        step = step * min(1.0, 4.0 / (pair.rate_hz * max(reach, 1e-12 / pair.rate_hz)))
        line = _Line(line.offset + line.drift * (middle - line.at) + step[0], line.drift + step[1], middle)
        if (np.abs(step) < 1e-3 * np.sqrt(np.abs(np.diag(covariance)))).all() or reach * pair.rate_hz < 1e-7:
            break
    errors = np.sqrt(np.abs(np.diag(covariance)))
    if not (abs(line.drift) < max(LARGEST_DIFFERENCE, 4.0 * errors[1]) and np.isfinite(errors).all()):
        came = f"clocks whose rates seem to differ by {line.drift:.2%}"
        do = "Choose a longer part, or a signal that changes faster."
        raise RecordingError(where, came, f"{LARGEST_DIFFERENCE:.1%} at most", do)
    correlation = float(np.corrcoef(_within(pair, spline, line, time), here)[0, 1])
    others = tuple(float(line.offset) + other - peaks.offset for other in peaks.others)
    digits = float(np.spacing(max(np.abs(pair.first_time).max(), np.abs(time).max())))
    sizes = float(line.offset), float(np.hypot(errors[0], digits)), float(line.drift), float(errors[1]), line.at
    return Offset(*sizes, correlation, peaks.margin, others)


@dataclass(frozen=True)
class _Line:
    """Offset [s] that grows with time, by `drift` [1], and its value at one time of the second clock."""

    offset: float
    drift: float
    at: float


def _within(pair: CommonSignal, spline: Callable[[Array], Array], line: _Line, time: Array) -> Array:
    """Values of the first recording (m,) at times of the second clock [s]."""
    there = time + line.offset + line.drift * (time - line.at)
    return np.asarray(spline(np.clip(there, pair.first_time[0], pair.first_time[-1])))


def _begun(pair: CommonSignal, line: _Line, rows: Mask, spline: Callable[[Array], Array]) -> _Line:
    """The line through the offsets of parts of the overlap, where these agree on a drift."""
    time, here = pair.second_time[rows], pair.second[rows]
    size, span = len(time) // PARTS, int(np.ceil(LARGEST_DIFFERENCE * len(time) / 2.0)) + 2
    if size < FEWEST_IN_PART:
        return line
    there = _within(pair, spline, line, time)
    at, shifts = [], []
    for low in range(0, PARTS * size, size):
        begin, end = max(low - span, 0), min(low + size + span, len(there))
        part, wide = here[low : low + size] - here[low : low + size].mean(), there[begin:end] - there[begin:end].mean()
        ones = np.ones(size)
        power = correlate(wide**2, ones, "valid") - correlate(wide, ones, "valid") ** 2 / size
        scale = np.sqrt(np.maximum(power, 1e-6 * size * float(pair.first.var())) * float(part @ part) + 1e-300)
        height = np.abs(correlate(wide, part, "valid")) / scale
        best = int(np.argmax(height))
        if height[best] > 0.5 and 0 < best < len(height) - 1:
            at.append(float(time[low : low + size].mean()))
            shifts.append((begin + best - low) / pair.rate_hz)
    if len(at) < PARTS // 2:
        return line
    slope, middle = theilslopes(shifts, at)[:2]
    left = np.abs(np.asarray(shifts) - middle - slope * np.asarray(at))
    if float(np.median(left)) * pair.rate_hz > 1.0 or abs(slope) * float(np.ptp(time)) * pair.rate_hz < 1.0:
        return line
    return _Line(line.offset + float(middle + slope * line.at), float(slope), line.at)


def _step(there: Array, here: Array, time: Array, rate_hz: float) -> tuple[Array, Array, float]:
    """Change of offset [s] and drift [1] towards the best ones, their covariance, and the middle for both [s].

    With the second signal :math:`y` and the first :math:`x` as it lies now, :math:`r = y - \\alpha x` grows with the
    slope of :math:`x` where it lies wrong; :math:`\\alpha` and the weights go with the frequency.
    """
    fade = tukey(len(time), FADED)
    fx, fy = rfft((there - there.mean()) * fade), rfft((here - here.mean()) * fade)
    frequency = rfftfreq(len(time), 1.0 / rate_hz)
    band = (frequency > 0.0) & (frequency <= HIGHEST_PART * rate_hz)
    turning = 1j * REVOLUTION * frequency
    (own, cross), lines = _smoothed((np.abs(fx) ** 2, fx.conj() * fy), len(fx))
    (other,), _ = _smoothed((np.abs(fy) ** 2,), len(fx))
    own, other = np.maximum(own.real, 1e-300), np.maximum(other.real, 1e-300)
    common = cross.real * np.sign(cross.real[band].sum())
    coherence = common**2 / own / other
    kept = band & (common > 0.0) & (coherence > INCOHERENT / lines)
    coherence = np.clip((coherence - 1.0 / lines) / (1.0 - 1.0 / lines), 0.0, CERTAIN)
    weight = np.where(kept, coherence / (1.0 - coherence) / np.maximum(common, 1e-300), 0.0)
    rest = np.where(band, fy - cross.real / own * fx, 0.0)
    slope = irfft(turning * weight * fx, len(time))
    gain = slope * irfft(np.where(band, turning, 0.0) * fy, len(time))
    middle = float(time @ gain / gain.sum()) if gain.sum() else float(time.mean())
    middle = min(max(middle, float(time[0])), float(time[-1]))
    powers = np.stack([np.ones(len(time)), time - middle])
    score = powers @ (slope * irfft(rest, len(time)))
    shape = (powers * gain) @ powers.T
    (noise,), _ = _smoothed((np.abs(rest) ** 2,), len(fx))
    left = np.where(band, noise.real * lines / (lines - 1.0), 0.0) / float(fade @ fade)
    bent = rfft(powers * slope * fade)
    spread = 2.0 * ((bent * left) @ bent.conj().T).real / len(time)
    used = np.abs(bent[0]) ** 2 * left
    spread *= 1.0 + FOR_FEW * float(used @ used) / max(float(used.sum()) ** 2, 1e-300)
    back = np.linalg.pinv(shape)
    return back @ score, back @ spread @ back.T, middle


def _smoothed(spectra: tuple[Spectrum | Array, ...], length: int) -> tuple[list[Spectrum], Array]:
    """Spectra smoothed over lines next to each other, and how many lines at each."""
    line = np.arange(length)
    half = np.maximum(FEWEST_LINES, (PART_OF_LINES * line).astype(np.int64))
    low, high = np.maximum(line - half, 0), np.minimum(line + half + 1, length)
    totals = [np.concatenate(([0.0], np.cumsum(one))).astype(np.complex128) for one in spectra]
    return [(total[high] - total[low]) / (high - low) for total in totals], (high - low).astype(np.float64)
