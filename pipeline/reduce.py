"""A window of samples reduced to means and what they are uncertain by."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import fft

from pmg.sim import sources
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    import polars as pl

    from pmg.pipeline.windows import Window
    from pmg.sim.signals import Array

CUTOFF_HZ = 0.5
"""Cut-off of the brick-wall filter that the bench's evaluation applies to the torques [Hz]."""
BATCHES = 10
"""Batches of a window: enough for a dependable scatter, long enough to outlive correlated noise."""
FEWEST_BATCHES = 5
"""Fewest batches of whole revolutions; below, the window is cut by time."""
COVERAGE = 0.9
"""Part of the window that batches of whole revolutions should use before their number is lowered."""

FILTER_SOURCE = sources.THESIS.at("evaluation of the tests: FFT low-pass filter at 0.5 Hz")
UNCERTAINTY_SOURCE = sources.FLEGAL_JONES.at("batch means estimator")


@dataclass(frozen=True)
class ShaftMeans:
    """One shaft over one window.

    Parameters
    ----------
    torque : float
        Mean torque after the filter [N m].
    within : float
        Standard uncertainty of that mean from what varies within the window [N m].
    dof : int
        Degrees of freedom of `within`.
    revolutions_per_batch : int
        Whole revolutions of each batch; 0 where batches are cut by time.
    std, std_filtered : float
        Standard deviation of the torque before and after the filter [N m].
    correlation_time : float
        Correlation time of the torque noise [s].
    speed : float
        Mean speed, from the angle at both ends [rad/s].
    """

    torque: float
    within: float
    dof: int
    revolutions_per_batch: int
    std: float
    std_filtered: float
    correlation_time: float
    speed: float


@dataclass(frozen=True)
class PointMeans:
    """Both shafts over one window.

    Parameters
    ----------
    n : int
        Samples with a torque of both shafts.
    duration : float
        Length of the window [s].
    sun, ring : ShaftMeans
        The shafts. A number that cannot be had (a gap, too few samples) is NaN.
    """

    n: int
    duration: float
    sun: ShaftMeans
    ring: ShaftMeans


@dataclass(frozen=True)
class Batches:
    """Means of consecutive pieces of a window.

    Parameters
    ----------
    means : (b,) array
        Mean of each piece; empty where the window is too short to be cut.
    length : float
        Samples of each piece.
    revolutions : int
        Whole revolutions of each piece; 0 where cut by time.
    """

    means: Array
    length: float
    revolutions: int


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
        sun=reduce_shaft(columns["torque_sun"], columns["angle_sun"], rate_hz),
        ring=reduce_shaft(columns["torque_ring"], columns["angle_ring"], rate_hz),
    )


def reduce_shaft(torque: Array, angle: Array, rate_hz: float) -> ShaftMeans:
    r"""Means of one shaft.

    Parameters
    ----------
    torque, angle : (n,) array
        Torque [N m] and angle [rad].
    rate_hz : float
        Sample rate [Hz].

    Notes
    -----
    The filter is applied to the window alone: applied to the whole record it lets a step next to the window leak
    into it. Its mean over the window is the plain mean; the scatter after it says nothing about the uncertainty
    of that mean, since neighbouring values are no longer independent. With the means :math:`y_i` of b batches of L
    samples,

    .. math:: u^2 = \frac{L}{n} \frac{1}{b-1} \sum_i (y_i - \bar y)^2 ,

    and the correlation time follows from :math:`u^2 = 2 s^2 \tau / t` for a window of length t. It comes out
    small where ripple makes up most of s. A gap in the torque leaves mean and standard deviation; the rest is NaN.

    References
    ----------
    `FILTER_SOURCE`, `UNCERTAINTY_SOURCE`.
    """
    known = torque[np.isfinite(torque)]
    speed = end_to_end_speed(angle, rate_hz)
    if len(known) < 2 or len(known) < len(torque):
        mean = float(known.mean()) if len(known) else math.nan
        std = float(known.std(ddof=1)) if len(known) > 1 else math.nan
        return ShaftMeans(mean, math.nan, 0, 0, std, math.nan, math.nan, speed)
    filtered = low_pass(torque, rate_hz, CUTOFF_HZ)
    std = float(torque.std(ddof=1))
    batches = batch_means(torque, angle)
    within, correlation_time = math.nan, math.nan
    if len(batches.means) > 1:
        variance = float(batches.means.var(ddof=1))
        within = math.sqrt(variance * batches.length / len(torque))
        if std > 0.0:
            correlation_time = within**2 * (len(torque) / rate_hz) / (2.0 * std**2)
    return ShaftMeans(
        torque=float(filtered.mean()),
        within=within,
        dof=max(0, len(batches.means) - 1),
        revolutions_per_batch=batches.revolutions,
        std=std,
        std_filtered=float(filtered.std(ddof=1)),
        correlation_time=correlation_time,
        speed=speed,
    )


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


def end_to_end_speed(angle: Array, rate_hz: float) -> float:
    """Mean speed [rad/s] from the first and the last known angle [rad]; NaN with fewer than two.

    Between samples, one count is more than a hundred rpm; between the ends of a window it is next to nothing.
    """
    known = np.flatnonzero(np.isfinite(angle))
    if len(known) < 2:
        return math.nan
    first, last = known[0], known[-1]
    return float((angle[last] - angle[first]) * rate_hz / (last - first))


def batch_means(torque: Array, angle: Array) -> Batches:
    """Means of consecutive pieces of a window without gaps in the torque.

    Parameters
    ----------
    torque, angle : (n,) array
        Torque [N m] and angle [rad] of the same shaft.

    Notes
    -----
    What repeats with each turn of the shaft is no noise of the mean, so where at least `FEWEST_BATCHES` batches of
    whole revolutions fit, each batch holds the same number of them: as many batches up to `BATCHES` as use
    `COVERAGE` of the window, else the number that uses most of it. Their borders fall between samples; the sum of
    the torque is interpolated there. Otherwise `BATCHES` pieces of equal time are taken, and ripple counts as
    noise, which errs on the safe side.
    """
    n = len(torque)
    turned = np.abs(angle - angle[0]) if np.isfinite(angle).all() else np.zeros(n)
    phase = np.maximum.accumulate(turned) / REVOLUTION
    count, revolutions = _whole_revolutions(float(phase[-1]))
    if count:
        borders = np.interp(np.arange(count + 1) * float(revolutions), phase, np.arange(n, dtype=np.float64))
    elif n >= 2 * BATCHES:
        borders = np.linspace(0.0, float(n), BATCHES + 1)
    else:
        return Batches(np.empty(0), 0.0, 0)
    total = np.concatenate(([0.0], np.cumsum(torque)))
    lengths = np.diff(borders)
    sums = np.diff(np.interp(borders, np.arange(n + 1, dtype=np.float64), total))
    return Batches(sums / lengths, float(lengths.mean()), revolutions)


def _whole_revolutions(turns: float) -> tuple[int, int]:
    """Number of batches and revolutions of each; (0, 0) where too few fit."""
    if turns < FEWEST_BATCHES:
        return 0, 0
    choices = [(b, int(turns // b)) for b in range(BATCHES, FEWEST_BATCHES - 1, -1) if turns >= b]
    for b, each in choices:
        if b * each >= COVERAGE * turns:
            return b, each
    return max(choices, key=lambda choice: choice[0] * choice[1])
