"""Noise of an angle: steps of its encoder as they fold into the band of the rows or stay, and jitter of the samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.optimize import brentq
from scipy.signal import csd, fftconvolve, welch

from pmg.pipeline.motion.quantisation import (
    QUANTISED_PIECE,
    folded_waves,
    quantisation_on_average,
    slowly_counted,
    step_directions,
)
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.motion.quantisation import QuantisationError
    from pmg.sim.shafts import PerShaft
    from pmg.sim.signals import Array, Mask

CREEPING = 0.2
"""Speed [rad/s] up to which a shaft stands or creeps: before it has moved faster, and after, nothing is said of it."""

OFFSETS = (0.125, 0.375, 0.625, 0.875)
"""Parts of a count by which the angle that is counted again is moved; a shaft at rest stands on a whole one."""

LOCAL = 0.05
"""Time over which the noise of the steps is told at an instant [s]."""

SHOWN_RATE = 250.0
"""Instants a second at which it is told [1/s]."""

HARMONICS = np.arange(1, 9)
"""Waves of the steps of a count that are taken."""

STILL = 0.6
"""Waves of the band, in counts, up to which they are taken for what steps make; these have 0.3 and less."""

LEAST = 0.05
"""Least part of the noise of even steps that is taken."""


@dataclass(frozen=True)
class NoiseCourse:
    """How the noise of an angle changes in a run: standard deviations over those of the whole run.

    Parameters
    ----------
    time : (q,) array
        Instants [s].
    curvature, value : (q,) array
        Of the second derivative, and of the angle itself.
    ordered : (q, w) array
        Directions of what steps are off in the second derivative where they follow an order, each as long as its
        standard deviation [rad/s2]: where the shaft turns back, the same each time at the same place, and where a
        speed is held that makes them a line at the edge of the band. No other noise holds it.
    """

    time: Array
    curvature: Array
    value: Array
    ordered: Array


EVEN = NoiseCourse(np.zeros(1), np.ones(1), np.ones(1), np.zeros((1, 0)))
"""Of an angle whose noise is the same all the time."""


@dataclass(frozen=True)
class AngleNoise:
    """Noise of a recorded angle in the band of the rows.

    Parameters
    ----------
    density : float
        Spectral density as the second derivative shows it [rad2/Hz], one-sided, over all that moves; without
        steps that come one by one.
    value_density : float
        The same as the angle itself shows it: lines low in the band count in full.
    quantisation : QuantisationError
        What the mean of the steps is off, which neither holds.
    course : NoiseCourse
        How both change in the run.
    jitter : float
        Spectral density of what jitter of the times of samples makes [rad2/Hz], one-sided; the others hold it.
    """

    density: float
    value_density: float
    quantisation: QuantisationError
    course: NoiseCourse = EVEN
    jitter: float = 0.0

    def density_at(self, time: Array) -> Array:
        """Spectral density as the second derivative shows it at some instants (n,) [rad2/Hz], one-sided."""
        return self.density * np.interp(time, self.course.time, self.course.curvature) ** 2

    def value_density_at(self, time: Array) -> Array:
        """The same as the angle itself shows it."""
        return self.value_density * np.interp(time, self.course.time, self.course.value) ** 2


def angle_noise(
    angle: Array, count: float, rate: float, filters: tuple[Array, Array, Array], above: Callable[[Array, float], Mask]
) -> AngleNoise:
    r"""Noise of an angle in a band.

    Parameters
    ----------
    angle : (n,) array
        As recorded [rad].
    count : float
        Its steps [rad].
    rate : float
        Samples a second [1/s].
    filters : tuple of (w,) array
        Weights of the band, of the second derivative in it, and of a part of it that hardly moves within one count.
    above : callable
        Which frequencies [Hz] of a record of that rate are well above the band.

    Returns
    -------
    AngleNoise
        In that band, and below it.

    Notes
    -----
    An encoder shows whole counts c. What they are off has the variance :math:`c^2/12`, and is white while the speed
    changes; at a speed that is held it is a line, :math:`|\omega/c - k f_s|/2\pi` off zero, that lies in the band or
    does not. A smooth angle is counted again to see how much of it does: one without the waves of the band where these
    are no larger than what steps make of themselves, as steps that are there already would count as none again. Jitter
    of size s between samples spreads the k-th wave of the steps: :math:`e^{-(2\pi k s/c)^2}` of its power is left; how
    large jitter is shows above the band, where all beyond the steps is taken for it. A line low in the band is next to
    nothing in the second derivative and whole in the angle, so that each has a density of its own. What steps make is
    told instant by instant: more while the speed changes than while one is held; where the shaft turns back it is no
    noise at all, as it comes again with the same place.

    References
    ----------
    B. Widrow, I. Kollár, 'Quantization Noise', Cambridge University Press (2008), chapters 4 and 17.
    """
    low, curved, calm = filters
    smooth, began = fftconvolve(angle, low, "valid"), len(low) // 2
    moving = np.flatnonzero(np.abs(np.gradient(smooth)) * rate > CREEPING)
    if len(moving) and moving[-1] - moving[0] > 2 * len(curved):
        angle, smooth = (part[moving[0] : moving[-1] + 1] for part in (angle[began:], smooth))
        began += int(moving[0])
    smooth = without_small_waves(smooth, STILL * count, calm)
    again = [np.floor(smooth / count + offset) * count for offset in OFFSETS]
    even = count**2 / 6.0 / rate
    off, slowly = [shown - smooth for shown in again], slowly_counted(smooth, count, rate)
    inside, of_value = (
        power / (0.5 * rate * float(weights @ weights))
        for weights, power in (
            (curved, np.mean([fftconvolve((1.0 - slowly) * each, curved, "valid") ** 2 for each in off], axis=0)),
            (low, np.mean([_quick_power(fftconvolve(each, low, "valid"), rate) for each in off], axis=0)),
        )
    )
    outside = float(np.mean([_above_band(shown, rate, above) for shown in again]))
    seen = _above_band(angle, rate, above)

    def beside(jitter: float, of_steps: Array) -> Array:
        kept = _kept(jitter * 0.5 * rate, count)
        return kept * of_steps + (1.0 - kept) * even + jitter

    jitter = 0.0
    if outside < seen:
        jitter = float(brentq(lambda size: float(beside(size, np.array(outside))) - seen, 0.0, seen))
    quantisation = quantisation_on_average(smooth, count, jitter * 0.5 * rate, rate, began / rate)
    over, every = max(round(LOCAL * rate), 1), max(round(rate / SHOWN_RATE), 1)
    at = [beside(jitter, np.maximum(uniform_filter1d(power, over), LEAST * even)) for power in (inside, of_value)]
    density, of_angle = (float(np.mean(power)) for power in at)
    curvature, value = (np.sqrt(power[::every] / np.mean(power)) for power in at)
    folded = folded_waves(smooth, count, rate, slowly)
    ordered = step_directions(smooth, count, jitter * 0.5 * rate, slowly, folded, curved)[::every]
    time = (began + len(curved) // 2 + every * np.arange(len(curvature))) / rate
    return AngleNoise(density, of_angle, quantisation, NoiseCourse(time, curvature, value, ordered), jitter)


def _quick_power(values: Array, rate: float) -> Array:
    """Squares of what is quicker than the mean over `QUANTISED_PIECE`."""
    slow = uniform_filter1d(values, min(round(QUANTISED_PIECE * rate), len(values)))
    return np.asarray((values - slow) ** 2)


def without_small_waves(smooth: Array, size: float, calm: Array) -> Array:
    """A smooth angle (n,), low-passed further wherever the waves that this takes out are smaller than some size [rad].

    The filter is used twice, on what it leaves as well, so that it lets a course of the third degree in time through.
    """
    half, width = len(calm) // 2, len(calm)

    def passed(values: Array) -> Array:
        return np.asarray(fftconvolve(np.pad(values, half, mode="reflect", reflect_type="odd"), calm, "valid"))

    once = passed(smooth)
    slow = once + passed(smooth - once)
    waves = smooth - slow
    around = uniform_filter1d(waves**2, width) - uniform_filter1d(waves, width) ** 2
    return np.where(around > size**2, smooth, slow)


def _kept(variance: float, count: float) -> float:
    """Part of the power of steps that keeps its shape beside a noise of some variance [rad2]."""
    waves = np.exp(-variance * (REVOLUTION * HARMONICS / count) ** 2)
    return float(np.sum(waves / HARMONICS**2) / np.sum(1.0 / HARMONICS**2))


def common_density(angles: PerShaft[Array], rate: float, above: Callable[[Array, float], Mask]) -> float:
    """Cross density of the noise of two angles of one recording [rad2/Hz], one-sided: jitter moves both at a time.

    It is that well above the band, where steps of the encoders have nothing in common.
    """
    sun, ring = np.diff(angles.sun), np.diff(angles.ring)
    frequency, density = csd(sun, ring, rate, nperseg=min(round(rate), len(sun)))
    at = above(frequency, rate)
    return float(np.mean(density[at].real / (4.0 * np.sin(np.pi * frequency[at] / rate) ** 2)))


def _above_band(angle: Array, rate: float, above: Callable[[Array, float], Mask]) -> float:
    """Spectral density of an angle's noise above the band [rad2/Hz]; of its steps, as the angle runs away."""
    step = np.diff(angle)
    frequency, density = welch(step, rate, nperseg=min(round(rate), len(step)))
    at = above(frequency, rate)
    return _middle_density(density[at] / (4.0 * np.sin(np.pi * frequency[at] / rate) ** 2), len(step) / rate)


def _middle_density(density: Array, seconds: float) -> float:
    """Mean of a white density that Welch's method gives in pieces of a second, by its median: lines do not lift it."""
    return float(np.median(density)) / median_over_mean(max((2.0 * seconds - 1.0) / 1.06, 1.0))


def median_over_mean(pieces: float) -> float:
    r"""Median over mean of a white density that Welch's method gives from some pieces.

    Notes
    -----
    Pieces of length L that overlap by half count as 2 T / L - 1 less 5 % where they are averaged, each with two degrees
    of freedom; the median of chi square with n of them is :math:`(1 - 2/9n)^3` times its mean (Wilson and Hilferty).
    Where the median of the pieces is taken, which scatters more, T / L count: to 4 % from four lengths on, by draws.
    """
    return float((1.0 - 1.0 / (9.0 * pieces)) ** 3)
