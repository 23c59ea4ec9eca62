"""Smooth signals of a run in motion: torques, angles and their derivatives, and rows made of them by a low-pass."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.signal import fftconvolve, firwin

from pmg.pipeline.motion.angle_noise import AngleNoise, angle_noise, common_density
from pmg.pipeline.motion.torque_noise import white_density
from pmg.sim.errors import FitError
from pmg.sim.shafts import PerShaft, per_shaft
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from pmg.pipeline.motion.run import MovingRun
    from pmg.sim.signals import Array, Mask

FINE_RATE = 250.0
"""Rate at which torques that are no linear function of a signal are worked out [1/s]."""

FINE_BAND, FINE_HALF = 80.0, 0.03
"""Cut-off of the filter before it [Hz] and half its length [s]: flat over the band of the rows."""

BAND, HALF = 28.0, 0.12
"""Cut-off of the low-pass of the rows [Hz], above the mode of the magnetic spring, and half its length [s]."""

STENCIL = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60.0
"""Weights of the central difference of the sixth order."""

LEAST_RATE = 250.0
"""Least samples a second of which noise can be told above the band of the rows [1/s]."""

CALM, CALM_HALF = 4.0, 0.3
"""Cut-off of the low-pass of an angle that is counted again for the noise of its steps [Hz], half its length [s]."""

PER_ROW = 3
"""Fine samples for each row."""

AT_ONCE = 16
"""Rows that are made in one product of matrices."""

MOST_COMMON = 0.9
"""Most of the noise of both angles that may be common to them."""

KAISER = 5.6
"""Shape of the window of both filters: 60 dB of stop band."""


@dataclass(frozen=True)
class SmoothShaft:
    """Signals of one shaft at the n fine samples of a run.

    Parameters
    ----------
    torque, torque_rate, torque_curvature : (n,) array
        Torque of the coupling and its derivatives in time [N m, N m/s, N m/s2].
    angle, speed, acceleration : (n,) array
        Of the motor [rad, rad/s, rad/s2].
    density : float
        Spectral density of the torque's white noise [(N m)2/Hz], one-sided.
    angle_noise : AngleNoise
        Of the angle: quantisation, and what the times of samples jitter.
    fault : (n,) array, optional
        What the transducer shows beyond the torque of the coupling [N m].
    """

    torque: Array
    torque_rate: Array
    torque_curvature: Array
    angle: Array
    speed: Array
    acceleration: Array
    density: float
    angle_noise: AngleNoise
    fault: Array | None = None

    @cached_property
    def turn(self) -> tuple[Array, Array]:
        """Cosine and sine of its angle (n,)."""
        return np.cos(self.angle), np.sin(self.angle)

    def acting(self, rate: float) -> tuple[Array, Array, Array]:
        """Torque that twists the coupling, and its derivatives: what is shown less the fault; `rate` of the samples."""
        if self.fault is None:
            return self.torque, self.torque_rate, self.torque_curvature
        slope = derivative(self.fault, rate)
        return self.torque - self.fault, self.torque_rate - slope, self.torque_curvature - derivative(slope, rate)


@dataclass(frozen=True)
class SmoothRun:
    """A run in motion with its signals smooth.

    Parameters
    ----------
    run : MovingRun
        The run.
    time : (n,) array
        Of the fine samples, since the first of the run [s].
    fine_rate : float
        Fine samples a second [1/s].
    shafts : PerShaft of SmoothShaft
        Signals of either shaft.
    measured : PerShaft of (m,) array
        Torque at the rows, NaN where a signal was lost [N m].
    common : float
        Cross density of the noise of both angles [rad2/Hz], one-sided.
    """

    run: MovingRun
    time: Array
    fine_rate: float
    shafts: PerShaft[SmoothShaft]
    measured: PerShaft[Array]
    common: float = 0.0

    def __len__(self) -> int:
        """Count of rows."""
        return len(self.measured.sun)

    @property
    def row_rate(self) -> float:
        """Rows a second [1/s]."""
        return self.fine_rate / PER_ROW

    @property
    def row_time(self) -> Array:
        """Time of the rows, since the first sample of the run [s]."""
        half = len(self.weights) // 2
        return self.time[half : len(self.time) - half : PER_ROW]

    @property
    def weights(self) -> Array:
        """Weights of the fine samples in a row."""
        return _low_pass(BAND, HALF, self.fine_rate)

    def in_band(self, fine: Array) -> Array:
        """A quantity at the fine samples (n,), low-passed as the rows are; it goes on evenly beyond its ends."""
        half = len(self.weights) // 2
        return np.asarray(np.convolve(np.pad(fine, half, mode="reflect", reflect_type="odd"), self.weights, "valid"))

    def rows(self, fine: Array) -> Array:
        """Rows (m, ...) of a quantity at the fine samples (n, ...), low-passed; all of it finite."""
        at_once, step = _of_many(BAND, HALF, self.fine_rate), PER_ROW * AT_ONCE
        count = max((len(fine) - len(self.weights)) // PER_ROW + 1, 0)
        if not count:
            return np.zeros((0, *fine.shape[1:]))
        blocks = -(-count // AT_ONCE)
        columns = np.zeros((at_once.shape[1] + step * (blocks - 1), math.prod(fine.shape[1:])))
        used = min(len(fine), len(columns))
        columns[:used] = fine[:used].reshape(used, -1)
        windows = sliding_window_view(columns, at_once.shape[1], axis=0)[::step].swapaxes(1, 2)
        return np.asarray(at_once @ windows).reshape(blocks * AT_ONCE, *fine.shape[1:])[:count]


def smooth(run: MovingRun) -> SmoothRun:
    """The smooth signals of a run.

    Notes
    -----
    All signals go through the same linear-phase filters, so that equations of motion hold between rows as they hold
    between signals. A torque that is no linear function of them is worked out at the fine samples, whose filter is
    flat over the band, and then low-passed like the rest. A missing stretch of a signal (NaN) is bridged by a straight
    line, and its rows are NaN.

    Raises
    ------
    FitError
        The run has fewer than `LEAST_RATE` samples a second.
    """
    if run.rate < LEAST_RATE:
        came, do = f"{run.rate:g} samples a second", "Record faster, or leave the run out."
        raise FitError(run.name, came, f"{LEAST_RATE:g} or more, so that noise shows above the band of the rows", do)
    step = _fine_step(run.rate)
    weights = _low_pass(FINE_BAND, FINE_HALF, run.rate)
    half = len(weights) // 2
    time = np.arange(half, len(run.torque.sun) - half, step) / run.rate

    filters = (*_of_rows(run.rate), _low_pass(CALM, CALM_HALF, run.rate))

    def through(values: Array) -> Array:
        return np.asarray(fftconvolve(values, weights, "valid")[::step])

    def shaft(side: str) -> SmoothShaft:
        torque, angle = bridged(run.torque[side]), bridged(run.angle[side])
        angle = angle - REVOLUTION * np.floor(angle[0] / REVOLUTION)
        speed, torque_rate = derivative(angle, run.rate), derivative(torque, run.rate)
        return SmoothShaft(
            torque=through(torque),
            torque_rate=through(torque_rate),
            torque_curvature=through(derivative(torque_rate, run.rate)),
            angle=through(angle),
            speed=through(speed),
            acceleration=through(derivative(speed, run.rate)),
            density=white_density(torque, run.rate, _above),
            angle_noise=angle_noise(angle, run.count[side], run.rate, filters, _above),
        )

    shafts = per_shaft(shaft)
    most = MOST_COMMON * math.sqrt(shafts.sun.angle_noise.density * shafts.ring.angle_noise.density)
    common = min(max(common_density(run.angle.map(bridged), run.rate, _above), -most), most)
    found = SmoothRun(run, time, run.rate / step, shafts, PerShaft(time, time), common)

    def measured(side: str) -> Array:
        known = np.isfinite(run.torque[side]) & np.isfinite(run.angle[side])
        lost = fftconvolve(~known, np.ones(len(weights)), "valid")[::step] > 0.5
        far = fftconvolve(lost, np.ones(len(found.weights)), "valid")[::PER_ROW] > 0.5
        return np.where(far, np.nan, found.rows(shafts[side].torque))

    return replace(found, measured=per_shaft(measured))


def row_weights(run: SmoothRun) -> tuple[Array, Array]:
    """Weights (w,) of the samples in a row of a signal, and in one of its second derivative."""
    return _of_rows(run.run.rate)


@lru_cache(maxsize=4)
def _of_rows(rate: float) -> tuple[Array, Array]:
    """The filter before the fine samples and that of the rows as one, and its second derivative: with their images."""
    step = _fine_step(rate)
    of_fine = _low_pass(BAND, HALF, rate / step)
    spread = np.zeros(step * (len(of_fine) - 1) + 1)
    spread[::step] = of_fine
    low = np.convolve(_low_pass(FINE_BAND, FINE_HALF, rate), spread)
    return low, derivative(derivative(low, rate), rate)


def _fine_step(rate: float) -> int:
    """Samples of a record of some rate from one fine sample to the next."""
    return max(round(rate / FINE_RATE), 1)


def fine_response(rate: float, frequency: Array) -> Array:
    """What the filter before the fine samples lets through of waves of some frequencies [Hz]; `rate` of the record."""
    weights = _low_pass(FINE_BAND, FINE_HALF, rate)
    tabled = np.linspace(0.0, 2.0 * FINE_BAND, 65)
    at = (np.arange(len(weights)) - len(weights) // 2) / rate
    passed = np.cos(REVOLUTION * tabled[:, None] * at) @ weights
    return np.interp(frequency, tabled, passed, right=0.0)


def derivative(values: Array, rate: float) -> Array:
    """Derivative in time of equidistant values (n,), by differences of the sixth order; of the second at either end."""
    found = np.gradient(values) * rate
    if len(values) > 2 * len(STENCIL):
        at = len(STENCIL) // 2
        found[at:-at] = np.correlate(values, STENCIL, "valid") * rate
    return np.asarray(found)


@lru_cache(maxsize=4)
def _of_many(cut_off: float, half_length: float, rate: float) -> Array:
    """Weights (`AT_ONCE`, w) of the fine samples in rows one after the other: a product of matrices is the filter."""
    weights = _low_pass(cut_off, half_length, rate)
    found = np.zeros((AT_ONCE, len(weights) + PER_ROW * (AT_ONCE - 1)))
    for row in range(AT_ONCE):
        found[row, PER_ROW * row : PER_ROW * row + len(weights)] = weights
    return found


@lru_cache(maxsize=16)
def _low_pass(cut_off: float, half_length: float, rate: float) -> Array:
    return np.asarray(firwin(2 * round(half_length * rate) + 1, cut_off, window=("kaiser", KAISER), fs=rate))


def bridged(values: Array) -> Array:
    """Values with missing stretches bridged by straight lines."""
    known = np.isfinite(values)
    at = np.arange(len(values))
    return values if known.all() else np.interp(at, at[known], values[known])


def _above(frequency: Array, rate: float) -> Mask:
    """Frequencies [Hz] at which a record of a rate shows noise and no motion."""
    return np.asarray((frequency > 3.0 * BAND) & (frequency < 0.4 * rate))
