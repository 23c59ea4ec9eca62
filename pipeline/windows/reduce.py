"""A window of samples reduced to means and what they are uncertain by."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import fft

from pmg.pipeline.recording.means import BATCH_METHOD, MEMORY_METHOD, PointMeans, ShaftMeans
from pmg.pipeline.windows.revolutions import WholeRevolutions, whole_revolutions
from pmg.pipeline.windows.window_mean import serial_mean
from pmg.sim import sources
from pmg.sim.signals import NORMAL_MAD, REVOLUTION

if TYPE_CHECKING:
    import polars as pl

    from pmg.pipeline.windows.revolutions import Batches
    from pmg.pipeline.windows.window import Window
    from pmg.sim.signals import Array

REDUCTION = 6
"""Version of what an ingest keeps of a recording: means, uncertainties, temperatures, samples masked in runs in motion.
Counted up with every change."""
CUTOFF_HZ = 0.5
"""Cut-off of the brick-wall filter that the bench's evaluation applies to the torques [Hz]."""
DOUBTED = 0.45
"""Weight of noise that batches cannot give the uncertainty of, beyond which all forms of noise that fit give it."""
FLAGGED = 0.3
"""Weight of noise that is not flat at the lowest frequencies of the window, beyond which the window is flagged."""
FLAGGED_BY_CHANCE = 0.01
"""Part of windows that are flagged although their noise is flat."""
LONG_MEMORY = 0.05
"""Correlation time, as part of the window, that counts as such where only that is known."""

STILL = 1e-12
"""Range of a torque, as part of its size or of 1 N m, below which it shows nothing but the rounding of numbers."""
SPIKE = 8.0
"""Distance of a spike from the median, in standard deviations of the samples."""
MOST_SPIKES = 0.125
"""Part of the samples that may be spikes."""
SAMPLED = 4096
"""Samples of a window from which its median is known well enough to tell spikes."""
GOLDEN = 0.6180339887498949
"""Part of a window by which one of them is ahead of the one before: no period of a signal keeps step with it."""
FEW_BINS = 256
"""Bins up to which a Fourier sum for each takes less time than the transform, and little memory."""
TOGETHER = 1024
"""Samples of a signal whose part in a Fourier coefficient is summed at once."""
RESOLVED = 0.5
"""Correlation time that the finer pieces can tell from none, as part of one of them."""

FILTER_SOURCE = sources.THESIS.at("evaluation of the tests: FFT low-pass filter at 0.5 Hz")
UNCERTAINTY_SOURCE = sources.FLEGAL_JONES.at("batch means estimator")


def reduce_window(samples: pl.DataFrame, window: Window, rate_hz: float) -> PointMeans:
    """Means of a window.

    Parameters
    ----------
    samples : polars.DataFrame
        Samples of the recording: `sample`, `torque_sun`, `torque_ring`, `angle_sun`, `angle_ring`.
    window : Window
        Which of them; accepted or not.
    rate_hz : float
        Sample rate [Hz].
    """
    offset = int(samples["sample"][0]) if samples.height else 0
    length = max(0, window.stop_sample - window.first_sample)
    part = samples.slice(max(0, window.first_sample - offset), length)
    columns = {name: part[name].to_numpy() for name in ("torque_sun", "torque_ring", "angle_sun", "angle_ring")}
    both = np.isfinite(columns["torque_sun"]) & np.isfinite(columns["torque_ring"])
    return PointMeans(
        n=int(np.count_nonzero(both)),
        duration=length / rate_hz,
        sun=_reduce_shaft(columns["torque_sun"], columns["angle_sun"], rate_hz),
        ring=_reduce_shaft(columns["torque_ring"], columns["angle_ring"], rate_hz),
    )


def _reduce_shaft(torque: Array, angle: Array, rate_hz: float) -> ShaftMeans:
    r"""Means of one shaft.

    Parameters
    ----------
    torque, angle : (n,) array
        Torque [N m] and angle [rad].
    rate_hz : float
        Sample rate [Hz].

    Notes
    -----
    The mean is taken over as many whole revolutions as fit: over a part of one, ripple leaves up to its amplitude
    over the number of radians turned, which may be many times the noise of the mean. The filter is applied to the
    window alone: applied to the whole record it lets a step next to the window leak into it. It would leave the mean
    as it is; the scatter after it says nothing about the uncertainty of that mean, since neighbouring values are no
    longer independent. With the means :math:`y_i` of b batches of L samples, and n samples in the mean,

    .. math:: u^2 = \frac{L}{n} \frac{1}{b-1} \sum_i (y_i - \bar y)^2 .

    The correlation time is learned from finer pieces of whole revolutions (`serial_mean`), and where it is shorter
    than half of one from :math:`u^2 = 2 s^2 \tau / t`, t the length of the mean and s the scatter that does not
    repeat from turn to turn. Where batches may miss u (`DOUBTED`), the finer pieces give it and its degrees of
    freedom. A gap in the torque leaves mean and standard deviation; the rest is NaN. A torque that does not vary
    (`STILL`) says nothing about its uncertainty: `within` is NaN, with no degrees of freedom, and the resolution too.

    References
    ----------
    `FILTER_SOURCE`, `UNCERTAINTY_SOURCE`, `BERGER_YANG` in `pmg.pipeline.windows.window_mean`.
    """
    sound = np.isfinite(torque)
    known = torque if sound.all() else torque[sound]
    speed = end_to_end_speed(angle, rate_hz)
    step = _resolution(known)
    if len(known) < 2 or len(known) < len(torque):
        mean = float(known.mean()) if len(known) else math.nan
        std = float(known.std(ddof=1)) if len(known) > 1 else math.nan
        return ShaftMeans(mean, math.nan, 0, 0, std, math.nan, math.nan, speed, resolution=step)
    turned = WholeRevolutions(torque, whole_revolutions(angle))
    batches = turned.batches()
    noise = _MeanNoise() if _still(torque) else _mean_noise(turned, batches, rate_hz)
    return ShaftMeans(
        torque=turned.mean(),
        within=noise.within,
        dof=noise.dof,
        revolutions_per_batch=batches.revolutions,
        std=float(torque.std(ddof=1)),
        std_filtered=_low_passed_std(torque, rate_hz, CUTOFF_HZ),
        correlation_time=noise.correlation_time,
        speed=speed,
        method=noise.method,
        correlated=noise.uneven,
        resolution=step,
        spikes=_moved_by_spikes(torque),
    )


@dataclass(frozen=True)
class _MeanNoise:
    """Uncertainty of the mean of a window.

    Parameters
    ----------
    within, dof, method, correlation_time
        As in `ShaftMeans`.
    uneven : bool
        The noise may not be flat at the lowest frequencies of the window: `ShaftMeans.correlated`.
    """

    within: float = math.nan
    dof: float = 0.0
    method: str = BATCH_METHOD
    correlation_time: float = math.nan
    uneven: bool = False


def mean_uncertainty(turned: WholeRevolutions, batches: Batches, rate_hz: float) -> tuple[float, float, str, float]:
    """Standard uncertainty of the mean, its degrees of freedom, where both come from, and the correlation time."""
    found = _mean_noise(turned, batches, rate_hz)
    return found.within, found.dof, found.method, found.correlation_time


def _mean_noise(turned: WholeRevolutions, batches: Batches, rate_hz: float) -> _MeanNoise:
    """Uncertainty of the mean of a window, from its batches or from its finer pieces."""
    if len(batches.means) < 2:
        return _MeanNoise()
    within = math.sqrt(float(batches.means.var(ddof=1)) * batches.length / turned.used)
    dof, scatter = float(len(batches.means) - 1), turned.scatter()
    short = within**2 * turned.used / rate_hz / (2.0 * scatter**2) if scatter > 0.0 else math.nan
    pieces = turned.pieces()
    count, found = len(pieces.means), serial_mean(pieces.means)
    if found is None:
        return _MeanNoise(within, dof, BATCH_METHOD, short, bool(short * rate_hz > LONG_MEMORY * len(turned.torque)))
    samples = count * pieces.length
    time = short if found.memory * count < RESOLVED else found.memory * samples / rate_hz
    if found.unsafe <= DOUBTED:
        return _MeanNoise(within, dof, BATCH_METHOD, time, found.uneven > FLAGGED)
    u = found.u * math.sqrt(samples / turned.used)
    return _MeanNoise(u, found.dof, MEMORY_METHOD, time, found.uneven > FLAGGED)


def _still(torque: Array) -> bool:
    """Whether a torque [N m] shows nothing but the rounding of numbers."""
    return len(torque) > 0 and float(np.ptp(torque)) <= STILL * max(1.0, float(np.max(np.abs(torque))))


def _moved_by_spikes(torque: Array) -> float:
    """How far samples far off the others move the mean of a torque [N m] (n,); 0 where there are none.

    Far off is `SPIKE` times the standard deviation that the median of the distances from the median gives. Normal noise
    does not pass that, nor does a sine. What more than `MOST_SPIKES` of the samples do is the signal, and no spike.
    """
    n = len(torque)
    some = torque if n <= SAMPLED else torque[(np.arange(SAMPLED) * GOLDEN % 1.0 * n).astype(np.intp)]
    middle = np.median(some)
    distance = np.abs(some - middle)
    step = float(np.min(distance, where=distance > 0.0, initial=math.inf))  # of a coarse signal most samples are one
    usual = np.abs(torque - middle) <= SPIKE * max(NORMAL_MAD * float(np.median(distance)), step)
    share = 1.0 - float(usual.mean())
    return float(torque.mean() - torque[usual].mean()) if 0.0 < share <= MOST_SPIKES else 0.0


def _resolution(torque: Array) -> float:
    """Step between neighbouring values [N m]: the middle one among those that occur; NaN where none differ."""
    if _still(torque):
        return math.nan
    steps = np.diff(np.unique(torque))
    return float(np.median(steps)) if len(steps) else math.nan


def low_pass(x: Array, rate_hz: float, cutoff_hz: float) -> Array:
    """Signal without its parts above a frequency: the brick-wall filter of the bench's evaluation.

    Parameters
    ----------
    x : (n,) array
        Signal.
    rate_hz : float
        Sample rate [Hz].
    cutoff_hz : float
        Highest frequency that is kept [Hz].

    Returns
    -------
    (n,) array
        With the same mean.

    References
    ----------
    `FILTER_SOURCE`.
    """
    spectrum = fft.rfft(x)
    spectrum[fft.rfftfreq(len(x), 1.0 / rate_hz) > cutoff_hz] = 0.0
    return np.asarray(fft.irfft(spectrum, n=len(x)), dtype=np.float64)


def _low_passed_std(x: Array, rate_hz: float, cutoff_hz: float) -> float:
    r"""Standard deviation of a signal after `low_pass`, in all but hours from the few bins below the cut-off alone.

    Parameters
    ----------
    x, rate_hz, cutoff_hz
        As for `low_pass`.

    Notes
    -----
    With the discrete Fourier transform :math:`X_k`, :math:`s^2 = \sum_k |X_k|^2 / (n (n - 1))` over the bins of both
    signs that are kept, but zero (Parseval). Each :math:`X_k` is summed over stretches of `TOGETHER` samples first.
    """
    n = len(x)
    bins = np.arange(1, min(int(cutoff_hz * n / rate_hz) + 1, n // 2) + 1)
    bins = bins[bins * (1.0 / (n * (1.0 / rate_hz))) <= cutoff_hz]
    if len(bins) > FEW_BINS:
        return float(low_pass(x, rate_hz, cutoff_hz).std(ddof=1))
    rows = np.zeros((-(-n // TOGETHER), TOGETHER))
    rows.reshape(-1)[:n] = x - x.mean()
    within = np.outer(np.arange(TOGETHER), bins) * (REVOLUTION / n)
    between = np.outer(np.arange(len(rows)) * TOGETHER, bins) % n * (REVOLUTION / n)
    found = ((rows @ np.cos(within) - 1j * (rows @ np.sin(within))) * np.exp(-1j * between)).sum(axis=0)
    sides = np.where(2 * bins == n, 1.0, 2.0)
    return math.sqrt(float((sides * np.abs(found) ** 2).sum()) / n / (n - 1))


def end_to_end_speed(angle: Array, rate_hz: float) -> float:
    """Mean speed [rad/s] from the first and the last known angle [rad]; NaN with fewer than two.

    Between samples, one count is more than a hundred rpm; between the ends of a window it is next to nothing.
    """
    ends = [0, len(angle) - 1]
    whole = len(angle) > 1 and bool(np.isfinite(angle[ends]).all())
    known = ends if whole else np.flatnonzero(np.isfinite(angle))
    if len(known) < 2:
        return math.nan
    first, last = known[0], known[-1]
    return float((angle[last] - angle[first]) * rate_hz / (last - first))
