"""A transducer that lags: what it shows of any torque."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.sim.signals import Array, Spectrum

FIRST_ORDER, EQUAL_LAGS, BUTTERWORTH = 0.0, 0.25, 0.5
"""Sharpness of a first-order lag, of two equal ones in series, and of a low-pass of Butterworth of the second order."""

FORGOTTEN = 10.0
"""Times of a lag after which nothing is left of what was before."""


@dataclass(frozen=True)
class Lag:
    r"""A low-pass of the first or second order: :math:`y = x / (1 + \tau s + k \tau^2 s^2)`.

    Parameters
    ----------
    side : str
        Shaft of the transducer.
    time : float
        By which it shows a ramp late [s].
    sharpness : float
        The factor k.
    """

    side: str
    time: float
    sharpness: float

    @property
    def told_from_delay(self) -> bool:
        """Whether it weakens waves in its band; one that does not is a delay, below the third power of a frequency."""
        return self.sharpness < BUTTERWORTH

    @property
    def corner(self) -> float:
        r"""Frequency at which it halves the power of a wave [Hz].

        There :math:`y = \omega \tau` fulfils :math:`(1 - k y^2)^2 + y^2 = 2`.
        """
        k = self.sharpness
        square = 1.0 if not k else (2.0 * k - 1.0 + np.hypot(2.0 * k - 1.0, 2.0 * k)) / (2.0 * k**2)
        return float(np.sqrt(square) / (REVOLUTION * self.time))

    def of(self, torque: Array, rate: float) -> Array:
        """Torques (n, k) at samples of a rate [1/s] as they are shown, steady before the first of them.

        Exact for waves below half the rate. Straight lines between the samples would lose 2 % of a wave of 20 Hz.
        """
        before = int(np.ceil(FORGOTTEN * self.time * rate)) + 1
        size = next_fast_len(len(torque) + 2 * before, real=True)
        after = size - len(torque) - before
        whole = np.pad(torque, ((before, after), (0, 0)), mode="edge")
        slope = (whole[-1] - whole[0]) / (size - 1)
        straight = whole[0] + slope * np.arange(size)[:, None]
        wave = np.asarray(1j * REVOLUTION * rfftfreq(size, 1.0 / rate), dtype=np.complex128)
        shown = irfft(rfft(whole - straight, axis=0) * self.response(wave)[:, None], size, axis=0)
        return np.asarray(shown + straight - slope * self.time * rate)[before : before + len(torque)]

    def response(self, rate: Spectrum) -> Spectrum:
        """What is shown of a wave, by its rate of change (f,)."""
        return np.asarray(1.0 / np.polyval(self._polynomial, rate))

    @property
    def _polynomial(self) -> list[float]:
        """Of the rate of change, highest power first."""
        square = [self.sharpness * self.time**2] if self.sharpness else []
        return [*square, self.time, 1.0]
