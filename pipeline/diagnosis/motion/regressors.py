"""Signals freed from the noise that the balance itself shows: what columns are made of."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.linalg import cholesky_banded
from scipy.linalg.lapack import dtbtrs
from scipy.signal import fftconvolve

from pmg.pipeline.diagnosis.motion.constants import coupling_loss_name
from pmg.pipeline.motion.smooth import MOST_COMMON, PER_ROW, derivative, row_weights
from pmg.sim.shafts import SIDES, PerShaft, other_side, per_shaft
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline
    from pmg.pipeline.motion.smooth import SmoothRun, SmoothShaft
    from pmg.sim.signals import Array, Mask, Spectrum

    Heard = Callable[[str, Spectrum], tuple[Spectrum | float, Spectrum | float]] | None

TAPS, NOTHING = 512, 1e-4
"""Fine samples of the Fourier transform that gives the weights of a row's noise: 2 s for a lag of up to 0.1 s;
and the weight, over the largest, below which it is taken for zero."""

REGULAR, UNKNOWN = 1e-4, 1e6
"""White part of a row, over its own variance, that keeps their covariance regular; and of a missing one, over the
largest variance. That of one shaft's rows may be a thousandth of the other's, a share of which would hide it."""

PASSES_FOR_NOISE = 3.0
"""Noise of a frequency, over its standard deviation, up to which a residual passes for noise: the rest is a cause."""


def with_instruments(
    baseline: MotionBaseline,
    faults: tuple[Array, ...] = (),
    heard: Heard = None,
) -> MotionBaseline:
    r"""A baseline with its signals freed from the noise that its residuals show.

    Parameters
    ----------
    baseline : MotionBaseline
        Fitted, with its residuals.
    faults : tuple of (n,) array
        What transducers show beyond the torque of their couplings, made of the signals as they are, at the fine samples
        of each stretch [N m]; none where empty.
    heard : callable, optional
        What such a fault holds of the noise of the own reading and of the other's, by side and rate of change (f,).

    Notes
    -----
    Noise in a column makes least squares biased: what a noisy acceleration explains is its own noise. A residual e is
    a known sum of the noises n of torques and angles, :math:`e = M n`, so that
    :math:`\hat n = S M^T (M S M^T)^{-1} e` with their variances S, which go with time, is the part of each that it
    tells, and what stays in the cleaned signals is uncorrelated with e at every instant. Columns made of them are
    instruments of those that were measured. What a residual has beyond noise stays in the signals.

    References
    ----------
    T. Söderström, 'Errors-in-variables methods in system identification', Automatica 43 (2007) 939, section 5.
    """
    found = {}
    places: dict[str, list[int]] = {}
    for place, stretch in enumerate(baseline.stretches):
        places.setdefault(stretch.run.run.name, []).append(place)
    for file, of_run in places.items():
        run = baseline.stretches[of_run[0]].run
        found[file] = (
            run if baseline.stretches[of_run[0]].at_rest else _without_noise(baseline, run, of_run, faults, heard)
        )
    return replace(baseline, instruments=tuple(replace(s, run=found[s.run.run.name]) for s in baseline.stretches))


def with_faults(baseline: MotionBaseline, of_stretch: tuple[Array, ...]) -> MotionBaseline:
    """A baseline that knows what transducers show too much at fine samples (n,): no torque that twists a coupling."""
    faults: dict[str, dict[str, Array]] = {}
    for stretch, fault in zip(baseline.stretches, of_stretch, strict=True):
        faults.setdefault(stretch.run.run.name, {})[stretch.side] = fault
    found: dict[str, SmoothRun] = {}
    for stretch in baseline.stretches:
        run, of_run = stretch.run, faults[stretch.run.run.name]
        shafts = PerShaft(*(replace(shaft, fault=of_run.get(side)) for side, shaft in run.shafts.items()))
        found[run.run.name] = replace(run, shafts=shafts)
    return replace(baseline, stretches=tuple(replace(s, run=found[s.run.run.name]) for s in baseline.stretches))


def _without_noise(
    baseline: MotionBaseline, run: SmoothRun, places: list[int], faults: tuple[Array, ...], heard: Heard
) -> SmoothRun:
    """A run less the noise that the residuals of its stretches show."""
    residual, known = np.zeros((len(run), len(places))), np.zeros((len(run), len(places)), dtype=np.bool_)
    for row, place in enumerate(places):
        stretch = baseline.stretches[place]
        known[stretch.rows, row] = True
        residual[stretch.rows, row] = (
            baseline.missing(place) - stretch.of_rows(faults[place]) if faults else baseline.left(place)
        )
    shows, covariance = _taps(baseline, run, places, heard), _of_noises(run)
    factor = _factor(run, shows, covariance, known)
    white = np.reshape(dtbtrs(factor, residual.reshape(-1, 1), uplo="L")[0], residual.shape)
    spectrum = np.fft.rfft(white, axis=0)
    size = np.sqrt(np.mean(np.abs(spectrum) ** 2, axis=1, keepdims=True) / len(run))
    white = np.fft.irfft(spectrum / np.maximum(size / PASSES_FOR_NOISE, 1.0), len(run), axis=0)
    told = np.zeros((len(run.time), len(places)))
    told[len(run.weights) // 2 :: PER_ROW][: len(run)] = np.reshape(
        dtbtrs(factor, white.reshape(-1, 1), uplo="L", trans="T")[0], white.shape
    )
    seen = [
        np.sum([fftconvolve(rows, taps, "same") for rows, taps in zip(told.T, of_noise, strict=True)], axis=0)
        for of_noise in shows.swapaxes(0, 1)
    ]
    noise = [np.zeros(len(run.time)) for _ in seen]
    for (one, another), power in covariance.items():
        noise[one] += power * seen[another]

    def clean(side: str) -> SmoothShaft:
        shaft, at = run.shafts[side], SIDES.index(side)
        (torque, torque_rate, torque_curvature), (angle, speed, acceleration) = (
            (values, slope := derivative(values, run.fine_rate), derivative(slope, run.fine_rate))
            for values in (noise[at], noise[len(SIDES) + at])
        )
        return replace(
            shaft,
            torque=shaft.torque - torque,
            torque_rate=shaft.torque_rate - torque_rate,
            torque_curvature=shaft.torque_curvature - torque_curvature,
            angle=shaft.angle - angle,
            speed=shaft.speed - speed,
            acceleration=shaft.acceleration - acceleration,
        )

    return replace(run, shafts=per_shaft(clean))


def _taps(baseline: MotionBaseline, run: SmoothRun, places: list[int], heard: Heard) -> Array:
    """Weights (r, 4, w) of the fine samples of each noise (torques, then angles) about a row, in each residual."""
    frequency = np.fft.rfftfreq(TAPS, 1.0 / run.fine_rate)
    mixing = _mixing(baseline, places, np.asarray(1j * REVOLUTION * frequency, dtype=np.complex128), heard)
    circle = np.fft.irfft(mixing * _response(run.weights, np.asarray(frequency / run.fine_rate)), TAPS)
    size = np.abs(circle) / np.maximum(np.max(np.abs(circle), axis=2, keepdims=True), np.finfo(float).tiny)
    act = np.flatnonzero(np.any(size > NOTHING, axis=(0, 1)))
    reach = min(int(np.max(np.minimum(act, TAPS - act), initial=0)), TAPS // 2 - 1)
    return np.asarray(circle[:, :, -np.arange(-reach, reach + 1)])


def _of_noises(run: SmoothRun) -> dict[tuple[int, int], Array]:
    """Variance of a fine sample of each noise (torques, then angles), and what two have in common, in time (n,)."""
    unit, (_, curvature) = 0.5 * run.fine_rate, row_weights(run)
    found = {}
    for k, shaft in enumerate(run.shafts[side] for side in SIDES):
        noise, course = shaft.angle_noise, shaft.angle_noise.course
        ordered = np.interp(run.time, course.time, np.sum(course.ordered**2, axis=1), left=0.0, right=0.0)
        as_white = ordered / (0.5 * run.run.rate * float(curvature @ curvature))
        found[k, k] = np.full(len(run.time), unit * shaft.density)
        found[2 + k, 2 + k] = unit * (noise.density_at(run.time) + as_white)
    most = MOST_COMMON * np.sqrt(found[2, 2] * found[3, 3])
    found[2, 3] = found[3, 2] = np.clip(unit * run.common, -most, most)
    return found


def _factor(run: SmoothRun, shows: Array, covariance: dict[tuple[int, int], Array], known: Mask) -> Array:
    """Lower factor, by diagonals, of the covariance of residuals (m, r) row by row; unknown ones weigh nothing."""
    count, width = len(shows), shows.shape[2]
    lags = (width - 1) // PER_ROW + 1
    later = np.stack([np.pad(shows, ((0, 0), (0, 0), (PER_ROW * lag, 0)))[:, :, :width] for lag in range(lags)])
    by_row = np.zeros((len(run), count * count * lags))
    for (one, another), power in covariance.items():
        if shows[:, one].any() and shows[:, another].any():
            around = sliding_window_view(np.pad(power, width // 2, mode="edge"), width)
            around = around[len(run.weights) // 2 :: PER_ROW][: len(run)]
            by_row += around @ np.einsum("rw,lsw->wrsl", shows[:, one], later[:, :, another]).reshape(width, -1)
    of_lag = by_row.reshape(len(run), count, count, lags)
    banded = np.zeros((lags * count, len(run) * count))
    for first, second in itertools.product(range(count), repeat=2):
        for lag in range(0 if second >= first else 1, min(lags, len(run))):
            place = slice(first, first + (len(run) - lag) * count, count)
            banded[lag * count + second - first, place] = of_lag[: len(run) - lag, first, second, lag]
    largest = float(banded[0].max()) or 1.0
    own = np.where(banded[0] > 0.0, banded[0], largest)
    banded[0] += np.where(known.ravel(), REGULAR * own, UNKNOWN * largest)
    return np.asarray(cholesky_banded(banded, lower=True, check_finite=False))


def _response(weights: Array, frequency: Array) -> Array:
    """What a symmetric filter lets through at frequencies in units of the rate of its samples."""
    at = np.arange(len(weights)) - len(weights) // 2
    return np.asarray(np.cos(REVOLUTION * frequency[:, None] * at) @ weights)


def _mixing(baseline: MotionBaseline, places: list[int], rate: Spectrum, heard: Heard) -> Spectrum:
    """What each noise (torques, then angles) adds to each residual of the stretches of a run, by frequency (r, 4, f).

    A torque's noise also twists the coupling, and a reading that is late holds some of its slope; of what the angles
    make, a transducer that lags shows less. The magnetic spring is as stiff as it is on average over the run.
    """
    sheet, values = baseline.sheet, baseline.values
    give = per_shaft(
        lambda side: (
            float(values[sheet.at(f"compliance_{side}")]) - float(values[sheet.at(coupling_loss_name(side))]) * rate
        )
    )
    mixing = np.zeros((len(places), 2 * len(SIDES), len(rate)), dtype=np.complex128)
    for row, place in enumerate(places):
        state = baseline.states[place]
        own = state.stretch.side
        of_motor: dict[str, Spectrum] = {own: float(values[sheet.at(f"inertia_{own}")]) * rate**2}
        if state.stretch.coupled:
            spring = (float(np.mean(state.spring[0])) + baseline.more_stiffness(place)) / sheet.poles[own]
            stiff = spring + float(values[sheet.at("slip_damping")]) * rate
            for side in SIDES:
                of_motor[side] = of_motor.get(side, 0.0 * rate) + sheet.poles[own] * sheet.poles[side] * stiff
        for lag in baseline.lags:
            if lag.side == own:
                of_motor = {side: lag.response(rate) * torque for side, torque in of_motor.items()}
        for side, torque in of_motor.items():
            at = SIDES.index(side)
            mixing[row, at] += give[side] * torque
            mixing[row, len(SIDES) + at] -= torque
        late = float(values[sheet.at(f"skew_{own}")]) * rate
        mixing[row, SIDES.index(own)] += 1.0 + late + 0.5 * late**2
        if heard is not None:
            for side, part in zip((own, other_side(own)), heard(own, rate), strict=True):
                mixing[row, SIDES.index(side)] -= part
    return mixing
