"""What steps of an encoder are off where they follow an order: where a speed is held, and where a shaft turns back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.signal import fftconvolve

from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.sim.signals import Array

QUANTISED_PIECE = 1.0
"""Time over which the mean of what steps are off is taken [s], about."""

FINEST = 40
"""Highest wave of the steps that is looked for in that mean."""

QUANTISED_LEAST = 9.0
"""Square of the mean of a wave of the steps, over that of steps without order, from which on it counts: one in 8000."""

IN_ROWS, WAVES_TAKEN = 45.0, (1, 2, 3)
"""Frequency [Hz] up to which waves of the steps come into the rows, as where a shaft turns back: beyond it is the stop
band of their low-pass of 28 Hz; and waves of the steps that are taken."""

IN_BAND = 24.0
"""Frequency [Hz] up to which a line of a held speed is as large in the rows as noise of the same power in the band."""

HELD = 0.2
"""Time for which a wave of quick steps, as samples show it, must stay between both [s]."""


@dataclass(frozen=True)
class QuantisationError:
    """What the steps of an encoder are off on average, which stays while a speed is held.

    Parameters
    ----------
    time : (q,) array
        Middles of pieces of about `QUANTISED_PIECE` of the record [s].
    spread : (q,) array
        Standard deviation of the mean over each [rad]; zero where the steps follow no order.
    """

    time: Array
    spread: Array


NO_ERROR = QuantisationError(np.zeros(0), np.zeros(0))
"""Of an encoder whose steps are not known."""


def quantisation_on_average(
    smooth: Array, count: float, variance: float, rate: float, began: float
) -> QuantisationError:
    r"""What the steps of a smooth angle from a time on are off on average, piece by piece.

    At a speed of a whole number of counts a sample, or of some samples, the steps are off by the same for as long as it
    is held, and nothing in the record tells by how much: it depends on where the angle stands within a count.
    `variance` is that of the jitter from sample to sample [rad2].

    Notes
    -----
    Over all places within a count, the mean error of the steps has the variance
    :math:`c^2 \sum_k |m_k|^2 e^{-(2\pi k s/c)^2}/(2\pi^2 k^2)` with the means :math:`m_k` of
    :math:`e^{2\pi i k x/c}` (Widrow and Kollár 2008, chapter 4).
    """
    edges = np.linspace(0, len(smooth), max(round(len(smooth) / (QUANTISED_PIECE * rate)), 1) + 1).astype(np.int64)
    samples = np.diff(edges)
    turn = np.exp(1j * REVOLUTION * (smooth / count))
    wave, found = np.ones_like(turn), np.zeros(len(samples))
    for k in range(1, FINEST + 1):
        wave = wave * turn
        seen = np.abs(np.add.reduceat(wave, edges[:-1]) / samples) ** 2
        kept = np.exp(-variance * (REVOLUTION * k / count) ** 2) / (2.0 * np.pi**2 * k**2)
        found += np.where(seen > QUANTISED_LEAST / samples, kept * seen, 0.0)
    time = np.asarray(began + 0.5 * (edges[:-1] + edges[1:]) / rate)
    return QuantisationError(time, np.asarray(count * np.sqrt(found)))


def slowly_counted(smooth: Array, count: float, rate: float) -> Array:
    """1 where the steps of a smooth angle (n,) come one by one, and 0 where they come twice as fast or faster (n,)."""
    return np.clip(2.0 - np.abs(np.gradient(smooth)) * rate / (IN_ROWS * count), 0.0, 1.0)


def folded_waves(smooth: Array, count: float, rate: float, slowly: Array) -> Array:
    """Parts (w, n) of the first waves of quick steps that are lines at the edge of the band, as a speed is held.

    1 where a wave folds to between `IN_BAND` and `IN_ROWS` for as long as `HELD`, 0 from half and twice that on, and
    where steps come `slowly`.
    """
    passed, samples, found = np.gradient(smooth) / count, max(round(HELD * rate), 1), []
    for k in WAVES_TAKEN:
        at = np.abs(k * passed - np.round(k * passed)) * rate
        below = 2.0 - maximum_filter1d(at, samples) / IN_ROWS
        above = 2.0 * minimum_filter1d(at, samples) / IN_BAND - 1.0
        found.append((1.0 - slowly) * np.clip(np.minimum(below, above), 0.0, 1.0))
    return np.stack(found)


def step_directions(smooth: Array, count: float, variance: float, slowly: Array, folded: Array, curved: Array) -> Array:
    r"""What steps are off in the second derivative where they follow an order: directions (m, w) [rad/s2].

    The error is :math:`\sum_k c/(\pi k) \sin(2\pi k (x + x_0)/c)`, a sum of two waves for each k whatever the place
    :math:`x_0` of the angle within a count is. Where steps come `slowly`, as where a shaft turns back, it is the same
    each time at the same place. Where a speed is held a wave is a line, and one that is `folded` to where the low-pass
    of the rows falls steeply is not what noise of the same power in the band would be there. `variance` is that of the
    jitter from sample to sample [rad2]. The density of the noise holds such a line as well, which makes it larger by as
    much while the speed is held.
    """
    waves = []
    for k, part in zip(WAVES_TAKEN, slowly + folded, strict=True):
        if part.any():
            turn = REVOLUTION * k / count
            size = count / (np.sqrt(2.0) * np.pi * k) * np.exp(-0.5 * variance * turn**2)
            wave = fftconvolve(size * part * np.exp(1j * turn * smooth), curved, "valid")
            waves += [wave.real, wave.imag]
    return np.stack(waves, 1) if waves else np.zeros((len(smooth) - len(curved) + 1, 0))
