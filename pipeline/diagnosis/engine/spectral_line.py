"""Lines in a spectrum: power at a frequency over that of its neighbours; rows where orders of a turn make none."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import maximum_filter1d, median_filter, minimum_filter1d

if TYPE_CHECKING:
    from pmg.sim.signals import Array, Mask

TURNING = 0.02
"""Part of its highest speed by which a machine must change its speed within a second for a row to count."""


def over_neighbours(power: Array, bins: int) -> Array:
    r"""Power (f,) of each frequency over that of so many to either side; of noise it is distributed exponentially.

    Notes
    -----
    The level is their median times :math:`1/\ln 2`, the ratio of mean and median of an exponential distribution, which
    a line among them hardly moves.
    """
    usual = median_filter(power, 2 * bins + 1, mode="reflect") / np.log(2.0)
    return np.asarray(power / np.maximum(usual, np.finfo(np.float64).tiny))


def swept(speed: Array, rate: float) -> Mask:
    """Rows (n,) [rate in Hz] about which a speed changes, so that orders of a turn sweep over frequencies."""
    second = max(round(rate), 1)
    change = maximum_filter1d(speed, second) - minimum_filter1d(speed, second)
    return np.asarray(change > TURNING * np.abs(speed).max())
