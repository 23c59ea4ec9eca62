"""Noise of an angle in the band of the rows: steps of its encoder as they fold into it, and jitter of the samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.optimize import brentq
from scipy.signal import csd, fftconvolve, welch

from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.sim.shafts import PerShaft
    from pmg.sim.signals import Array, Mask

CREEPING = 0.2
"""Speed [rad/s] up to which a shaft stands or creeps: before it has moved faster, and after, nothing is said of it."""

OFFSETS = (0.25, 0.75)
"""Parts of a count by which the angle that is counted again is moved; a shaft at rest stands on a whole one."""

HARMONICS = np.arange(1, 9)
"""Waves of the steps of a count that are taken."""

STILL = 0.6
"""Waves of the band, in counts, up to which they are taken for what steps make; these have 0.3 and less."""

LEAST = 0.05
"""Least part of the noise of even steps that is taken."""


PLACES = np.arange(11) / 11.0
"""Parts of a count by which an angle is moved to see what its steps may be off for long: a prime number of them, so
that they lie evenly within a half, a third or a tenth of a count, too."""

HELD_PIECE = 1.0
"""Time over which the mean of what steps are off is taken [s]."""

HELD_LEAST = 3.0
"""Standard deviation of that mean, over what steps without order leave of it, from which on it counts."""


@dataclass(frozen=True)
class HeldSteps:
    """What the steps of an encoder may be off for long, where a speed is held.

    Parameters
    ----------
    time : (q,) array
        Middles of pieces of `HELD_PIECE` of the record [s].
    spread : (q,) array
        Standard deviation of the mean of what the steps are off over each [rad]; zero where they follow no order.
    """

    time: Array
    spread: Array


def angle_noise(
    angle: Array, count: float, rate: float, filters: tuple[Array, Array, Array], above: Callable[[Array, float], Mask]
) -> tuple[float, HeldSteps]:
    r"""Spectral density of an angle's noise in a band [rad2/Hz], one-sided, and what its steps are off for long.

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

    Notes
    -----
    An encoder shows whole counts c. What they are off has the variance :math:`c^2/12`, and is white while the speed
    changes; at a speed that is held it is a line, :math:`|\omega/c - k f_s|/2\pi` off zero, that lies in the band or
    does not. A smooth angle is counted again to see how much of it does: one without the waves of the band where these
    are no larger than what steps make of themselves, as steps that are there already would count as none again. Jitter
    of size s between samples spreads the k-th wave of the steps: :math:`e^{-(2\pi k s/c)^2}` of its power is left; how
    large jitter is shows above the band, where all beyond the steps is taken for it.

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
    power = [float(np.mean(fftconvolve(shown - smooth, curved, "valid") ** 2)) for shown in again]
    inside = max(float(np.mean(power)) / (0.5 * rate * float(curved @ curved)), LEAST * even)
    outside = float(np.mean([_above_band(shown, rate, above) for shown in again]))
    seen = _above_band(angle, rate, above)

    def beside(jitter: float, of_steps: float) -> float:
        kept = _kept(jitter * 0.5 * rate, count)
        return kept * of_steps + (1.0 - kept) * even + jitter

    jitter = float(brentq(lambda size: beside(size, outside) - seen, 0.0, seen)) if outside < seen else 0.0
    return beside(jitter, inside), _held_steps(smooth, count, jitter * 0.5 * rate, rate, began / rate)


def _held_steps(smooth: Array, count: float, variance: float, rate: float, began: float) -> HeldSteps:
    """What the steps of a smooth angle from a time on may be off for long.

    At a speed of a whole number of counts a sample, or of some samples, the steps are off by the same for as long as it
    is held, and nothing in the record tells by how much: it depends on where the angle stands within a count.
    `variance` is that of the jitter from sample to sample [rad2].
    """
    length = round(HELD_PIECE * rate)
    pieces = len(smooth) // length
    shaken = smooth[: pieces * length] + np.sqrt(variance) * np.random.default_rng(0).standard_normal(pieces * length)
    off = [count * (np.floor(shaken / count + place) - place) - shaken for place in PLACES]
    spread = np.asarray(np.std([each.reshape(pieces, length).mean(axis=1) for each in off], axis=0, ddof=1))
    time = np.asarray(began + (np.arange(pieces) + 0.5) * length / rate)
    return HeldSteps(time, np.where(spread > HELD_LEAST * count / np.sqrt(12.0 * length), spread, 0.0))


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
