"""The low-pass of a recording: position, speed and acceleration from it, how long it takes to settle."""

from __future__ import annotations

from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.signal import butter, cheby1, sosfiltfilt

if TYPE_CHECKING:
    from pmg.pipeline.machine.channel import PrepareTable
    from pmg.sim.signals import Array

SETTLED, SETTLED_PERIODS = 1e-3, 12.0
"""Part of a response that is left once a filter has settled, and periods of its cut-off in which it surely has."""

FURTHER = 5.0
"""How much lower the low-pass of a reading lies that stands on both sides of the balance."""

DECIMATION = 2
"""Thinned samples at either end that the decimation spoils."""


STRETCHES = 12
"""Stretches, half overlapping, over which a spectrum is averaged."""

NOISE_BEYOND = 10.0
"""Signal and noise over noise, in power, up to which all that an acceleration holds of a frequency is taken out."""


@cache
def _decimation(keep_every: int) -> Array:
    """The filter of `scipy.signal.decimate`, as second-order sections; thousands of columns go through the same one."""
    return np.asarray(cheby1(8, 0.05, 0.8 / keep_every, output="sos"))


def kept(columns: Array, keep_every: int) -> Array:
    """What decimation keeps of columns (n, ...) at the full rate, filtered without phase along the first axis."""
    return columns if keep_every == 1 else np.asarray(sosfiltfilt(_decimation(keep_every), columns, axis=0))


class Smoother:
    """The low-pass of a recording, its derivatives, and what they make of noise.

    Parameters
    ----------
    given : PrepareTable
        Order and cut-off.
    step : float
        Time from sample to sample [s].
    """

    def __init__(self, given: PrepareTable, step: float) -> None:
        self.step, self.keep_every = step, given.keep_every
        self.order = given.order
        self.filter = butter(given.order, given.low_pass_hz, fs=1.0 / step, output="sos")
        self.beyond = 1.0 - 2.0 * given.low_pass_hz * step
        """Part of white noise that the low-pass takes out."""

    def smooth(self, values: Array) -> Array:
        """Low-passed without phase (n,)."""
        return np.asarray(sosfiltfilt(self.filter, values))

    def smoothed_further(self, values: Array) -> Array:
        """A reading that columns are made of (n,), low-passed `FURTHER` times as low.

        The force that they explain holds its noise too: left in, it would explain itself.
        """
        return np.asarray(sosfiltfilt(self._further, values))

    def slope(self, values: Array) -> Array:
        """Central differences of fourth order in time (n,); zero at either end."""
        found = np.zeros_like(values)
        found[2:-2] = (8.0 * (values[3:-1] - values[1:-3]) - (values[4:] - values[:-4])) / (12.0 * self.step)
        return found

    def moved(self, position: Array | None, velocity: Array | None) -> tuple[Array, Array, tuple[float, float]]:
        """Position and speed (n,), and the standard deviations that noise gives speed and acceleration."""
        if velocity is not None:
            speed = self.smooth(velocity)
            noise = self._noise(velocity - speed, self.weights)
            path = cumulative_trapezoid(speed, dx=self.step, initial=0) if position is None else self._path(position)
            return np.asarray(path), speed, noise
        assert position is not None  # a case has one of them
        path = self._path(position)
        return path, self.slope(path), self._noise(position - path, self.slope(self.weights))

    def _path(self, position: Array) -> Array:
        """The low-pass of a position (n,), from where it begins: one that stands leaves nothing to round."""
        return np.asarray(position[0] + self.smooth(position - position[0]))

    def noise_in(self, acceleration: Array, deviation: float, *, of_position: bool) -> Array:
        r"""What may be noise in an acceleration (n,), as a filter after Wiener takes it out.

        Parameters
        ----------
        acceleration : (n,) array
            Made of a speed or a position [m/s2, rad/s2].
        deviation : float
            Standard deviation of its noise, as `moved` gives it.
        of_position : bool
            Whether it was made of a position.

        Notes
        -----
        White noise of the reading goes through low-pass and slope, so its spectrum is known but for its size. Each
        frequency gives up the part :math:`\min(10 S_\mathrm{noise} / S_\mathrm{acceleration}, 1)`, ten times what is
        best for the acceleration itself: what is left of the noise stands on both sides of the balance.
        """
        reach = len(acceleration)
        width = min(max(reach // STRETCHES, 16), reach)
        stretches = np.lib.stride_tricks.sliding_window_view(acceleration, width)[:: max(width // 2, 1)]
        window = np.hanning(width)
        at = np.fft.rfftfreq(width, self.step)
        spectra = np.abs(np.fft.rfft(window * (stretches - stretches.mean(axis=1)[:, None]), axis=1)) ** 2
        whole = 2.0 * self.step * spectra.mean(axis=0) / float(window @ window)
        weights = self.slope(self.slope(self.weights) if of_position else self.weights)
        own = np.interp(at, np.fft.rfftfreq(len(weights), self.step), np.abs(np.fft.rfft(weights)) ** 2)
        own *= deviation**2 / max(float(np.trapezoid(own, at)), 1e-300)
        part = np.minimum(NOISE_BEYOND * own / np.maximum(whole, 1e-300), 1.0)
        mirrored = np.r_[acceleration, acceleration[::-1]]
        shares = np.interp(np.fft.rfftfreq(2 * reach, self.step), at, part)
        return np.asarray(np.fft.irfft(shares * np.fft.rfft(mirrored), 2 * reach)[:reach])

    def _noise(self, taken: Array, weights: Array) -> tuple[float, float]:
        """What weights and their slope make of white noise, of which the low-pass took a part."""
        inner = taken[len(taken) // 20 : -(len(taken) // 20) or None]
        white = float(np.sqrt(np.mean(inner**2) / self.beyond))
        return white * float(np.linalg.norm(weights)), white * float(np.linalg.norm(self.slope(weights)))

    @cached_property
    def weights(self) -> Array:
        """Weights of the low-pass, centred."""
        reach = max(round(SETTLED_PERIODS / self.cut_off / self.step), 8)
        return self.smooth(np.eye(1, 2 * reach + 1, reach)[0])

    @cached_property
    def _further(self) -> Array:
        """The lower low-pass of `smoothed_further`."""
        return np.asarray(butter(self.order, self.cut_off / FURTHER, fs=1.0 / self.step, output="sos"))

    @property
    def weights_further(self) -> Array:
        """Weights of it, centred."""
        reach = max(round(FURTHER * SETTLED_PERIODS / self.cut_off / self.step), 8)
        return self.smoothed_further(np.eye(1, 2 * reach + 1, reach)[0])

    @property
    def settles_further(self) -> int:
        """The same of `smoothed_further`."""
        return round(FURTHER * self.settles)

    @property
    def cut_off(self) -> float:
        """Cut-off [Hz]."""
        return 0.5 * (1.0 - self.beyond) / self.step

    @property
    def settles(self) -> int:
        """Samples at either end that the low-pass, its second derivative and the decimation spoil."""
        bent = np.abs(self.slope(self.slope(self.weights)))
        middle = len(bent) // 2
        beyond = np.cumsum(bent[middle:][::-1])[::-1] / np.sum(bent[middle:])
        own = int(np.argmax(beyond < SETTLED))
        return own + (DECIMATION * self.keep_every if self.keep_every > 1 else 0)
