"""A transducer that lags: what it shows of any torque."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.signal import lfilter

if TYPE_CHECKING:
    from pmg.sim.signals import Array, Spectrum


@dataclass(frozen=True)
class Lag:
    r"""Lags of equal time, one after the other: :math:`y = x / (1 + \tau s / n)^n`.

    Parameters
    ----------
    side : str
        Shaft of the transducer.
    time : float
        Of all together [s].
    order : int
        How many.
    """

    side: str
    time: float
    order: int

    def of(self, torque: Array, rate: float) -> Array:
        """Torques (n, k) at fine samples of a rate [1/s] as they are shown; straight lines between them, exactly."""
        kept = float(np.exp(-self.order / (rate * self.time)))
        mean = (1.0 - kept) * self.time * rate / self.order
        found = torque
        for _ in range(self.order):
            found = found[0] + lfilter([1.0 - mean, mean - kept], [1.0, -kept], found - found[0], axis=0)
        return np.asarray(found)

    def response(self, rate: Spectrum) -> Spectrum:
        """What is shown of a wave, by its rate of change (f,)."""
        return np.asarray((1.0 + rate * self.time / self.order) ** -self.order)
