"""Signals freed from the noise that the balance itself shows: what columns are made of."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.motion.smooth import PER_ROW
from pmg.sim.shafts import SIDES, PerShaft, other_side, per_shaft
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    from collections.abc import Callable

    from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline
    from pmg.pipeline.motion.smooth import SmoothRun, SmoothShaft
    from pmg.sim.signals import Array, Spectrum

    Heard = Callable[[str, Spectrum], tuple[Spectrum | float, Spectrum | float]] | None

PASSING = 0.02
"""Part of a frequency that the low-pass of the rows must let through for its noise to be known before that filter."""


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
    :math:`\hat n = S M^H (M S M^H)^{-1} e` with their spectral densities S is the part of each that it tells, and what
    stays in the cleaned signals is uncorrelated with e. Columns made of them are instruments of those that were
    measured. What a residual has beyond noise stays in the signals.

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
    residual = np.zeros((len(places), len(run)))
    for row, place in zip(residual, places, strict=True):
        stretch = baseline.stretches[place]
        row[stretch.rows] = baseline.missing(place) - stretch.of_rows(faults[place]) if faults else baseline.left(place)
    frequency = np.fft.rfftfreq(2 * len(run), 1.0 / run.row_rate)
    rate = np.asarray(1j * REVOLUTION * frequency, dtype=np.complex128)
    mixing = _mixing(baseline, places, rate, heard)
    shafts = [run.shafts[side] for side in SIDES]
    density = np.diag([each.density for each in shafts] + [each.angle_noise.density for each in shafts])
    density[-1, -2] = density[-2, -1] = run.common
    weighted = density @ mixing.conj().transpose(2, 1, 0)
    inverse = np.linalg.inv(mixing.transpose(2, 0, 1) @ weighted)
    spectrum = np.fft.rfft(residual, 2 * len(run))
    passed = _response(run.weights, np.asarray(frequency / run.fine_rate))
    told = inverse @ spectrum.T[:, :, None]
    noise = (weighted @ told)[:, :, 0].T / np.where(passed > PASSING, passed, np.inf)
    power = np.sum(spectrum.conj() * told[:, :, 0].T, axis=0).real / (0.5 * len(run) * run.row_rate * len(places))
    noise /= np.maximum(np.sqrt(power) / np.maximum(PASSES_FOR_NOISE * passed, PASSING), 1.0)

    first, fine = len(run.weights) // 2, PER_ROW * len(run)

    def less(signal: Array, values: Spectrum) -> Array:
        changed = signal.copy()
        part = changed[first : first + fine]
        part -= PER_ROW * np.fft.irfft(values, 2 * fine)[: len(part)]
        return changed

    def clean(side: str) -> SmoothShaft:
        shaft, at = run.shafts[side], SIDES.index(side)
        torque, angle = noise[at], noise[2 + at]
        return replace(
            shaft,
            torque=less(shaft.torque, torque),
            torque_rate=less(shaft.torque_rate, rate * torque),
            torque_curvature=less(shaft.torque_curvature, rate**2 * torque),
            angle=less(shaft.angle, angle),
            speed=less(shaft.speed, rate * angle),
            acceleration=less(shaft.acceleration, rate**2 * angle),
        )

    return replace(run, shafts=per_shaft(clean))


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
    peak = float(values[sheet.at("pull_out")])
    give = per_shaft(lambda side: float(values[sheet.at(f"compliance_{side}")]))
    mixing = np.zeros((len(places), 2 * len(SIDES), len(rate)), dtype=np.complex128)
    for row, place in enumerate(places):
        state = baseline.states[place]
        own = state.stretch.side
        of_motor: dict[str, Spectrum] = {own: float(values[sheet.at(f"inertia_{own}")]) * rate**2}
        if state.stretch.coupled:
            stiff = peak * float(np.mean(np.cos(state.pole_angle))) + float(values[sheet.at("slip_damping")]) * rate
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
