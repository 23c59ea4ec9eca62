"""The amplitude spectrum of a window, in few bins."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy import fft

from pmg.pipeline.point_signals.cell import Spectrum
from pmg.sim import sources
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.sim.signals import Array

MOST = 200
"""Most bins of frequency."""
PADDING = 4
"""Length of the transform over that of the window, so that three lines stand on the top of a peak."""
LOWEST = 2.0
"""Lowest frequency, in periods over the window: below, the taper lets a sine and its mirror image run together."""
FEWEST = 16
"""Samples below which there is no spectrum."""
SOURCE = sources.PERCIVAL_WALDEN.at("section 6.4: tapers")


def amplitude_spectrum(x: Array, rate_hz: float, most: int = MOST) -> Spectrum | None:
    r"""Amplitudes of a signal against frequency; None of too few samples or one with gaps.

    Parameters
    ----------
    x : (n,) array
        The signal over its window.
    rate_hz : float
        Sample rate [Hz].
    most : int
        Most bins, equally wide on a logarithmic scale; those that hold no line are left out.

    Notes
    -----
    With the Hann taper :math:`w_k`, the mean under it removed,

    .. math:: A(f) = \frac{2}{\sum_k w_k} \left| \sum_k w_k (x_k - \bar x) e^{-2 \pi i f k / r} \right| ,

    on lines `PADDING` times as dense as the window tells apart. The largest of a bin is kept, so noise shows its peaks
    and not its mean. Where it is the top of a peak, it is that of the parabola through it and the lines next to it,
    within 0.2 % of the amplitude of a sine that stands alone.

    References
    ----------
    `SOURCE`.
    """
    n = len(x)
    if n < FEWEST or not np.isfinite(x).all():
        return None
    taper = 0.5 - 0.5 * np.cos(REVOLUTION * np.arange(n) / n)
    total = float(taper.sum())
    padded = fft.next_fast_len(PADDING * n, real=True)
    amplitude = np.abs(fft.rfft(taper * (x - float(taper @ x) / total), n=padded)) * (2.0 / total)
    frequency = fft.rfftfreq(padded, 1.0 / rate_hz)
    lowest, highest = LOWEST * rate_hz / n, rate_hz / 2.0
    first, stop = np.searchsorted(frequency, (lowest * (1.0 - 1e-9), highest * (1.0 - 1e-9)))
    stop = min(stop, len(frequency) - 1)  # a line next to each
    edges = np.geomspace(lowest, highest, most + 1)[:-1] * (1.0 - 1e-9)
    starts = np.unique(first + np.searchsorted(frequency[first:stop], edges))
    starts = starts[starts < stop]
    largest = np.array([a + int(amplitude[a:b].argmax()) for a, b in pairwise([*starts.tolist(), int(stop)])])
    before, at, after = (amplitude[largest + shift] for shift in (-1, 0, 1))
    bend = before - 2.0 * at + after
    peak = (at >= before) & (at >= after) & (bend < 0.0)
    aside = np.divide(0.5 * (before - after), bend, out=np.zeros(len(at)), where=peak)
    return Spectrum(
        frequency=frequency[largest] + aside * rate_hz / padded,
        amplitude=at - 0.25 * (before - after) * aside,
        resolution=rate_hz / n,
    )
