"""Noise of a torque: how dense it is above the band of the rows, and how much denser in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import welch

from pmg.pipeline.motion.angle_noise import median_over_mean

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.sim.signals import Array, Mask

PIECE, CALM_PIECE = 0.25, 1.0
"""Length of the pieces of a record of which the noise of its torque is told, and of one at rest, in the band [s]."""


def white_density(torque: Array, rate: float, above: Callable[[Array, float], Mask]) -> float:
    """Spectral density of a torque's noise well above the band [(N m)2/Hz], one-sided.

    It is that of most pieces of the record, as a load that changes at once has power at every frequency for a moment.

    Parameters
    ----------
    torque : (n,) array
        A record of it [N m].
    rate : float
        Its samples a second [1/s].
    above : callable
        Which frequencies are above the band.
    """
    frequency, density, unbiased = _by_pieces(torque, rate, PIECE)
    return float(np.median(density[above(frequency, rate)])) / unbiased


def band_density(torque: Array, rate: float, low: float, high: float) -> float:
    """The same between two frequencies [Hz], of half of the lines there: a few that stand out do not lift it.

    Below the band's end of a shaft at rest, as anything else moves there.
    """
    frequency, density, unbiased = _by_pieces(torque, rate, CALM_PIECE)
    return float(np.median(density[(frequency > low) & (frequency < high)])) / unbiased


def _by_pieces(torque: Array, rate: float, length: float) -> tuple[Array, Array, float]:
    """Frequencies [Hz], median density of the pieces of a record, and that over its mean."""
    piece = min(round(length * rate), len(torque))
    frequency, density = welch(torque, rate, nperseg=piece, average="median")
    return frequency, density, median_over_mean(len(torque) / piece)
