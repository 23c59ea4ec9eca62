"""Signals freed from the noise that the balance itself shows: what columns are made of."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.motion.smooth import PER_ROW
from pmg.sim.shafts import SIDES, PerShaft, per_shaft
from pmg.sim.signals import REVOLUTION

if TYPE_CHECKING:
    import numpy.typing as npt

    from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline
    from pmg.pipeline.motion.smooth import SmoothRun, SmoothShaft
    from pmg.sim.signals import Array

    Spectrum = npt.NDArray[np.complex128]

PASSING = 0.02
"""Part of a frequency that the low-pass of the rows must let through for its noise to be known before that filter."""


def with_instruments(baseline: MotionBaseline) -> MotionBaseline:
    r"""A baseline with its signals freed from the noise that its residuals show.

    Notes
    -----
    Noise in a column makes least squares biased: what a noisy acceleration explains is its own noise. A residual e is
    a known sum of the noises n of torques and angles, :math:`e = M n`, so that
    :math:`\hat n = S M^H (M S M^H)^{-1} e` with their spectral densities S is the part of each that it tells, and what
    stays in the cleaned signals is uncorrelated with e. Columns made of them are instruments of those that were
    measured.

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
        found[file] = run if baseline.stretches[of_run[0]].at_rest else _without_noise(baseline, run, of_run)
    return replace(baseline, instruments=tuple(replace(s, run=found[s.run.run.name]) for s in baseline.stretches))


def with_faults(baseline: MotionBaseline) -> MotionBaseline:
    """A baseline whose mechanisms beside it are faults of transducers: they are no torque that twists a coupling."""
    faults: dict[str, dict[str, Array]] = {}
    for stretch, fault in zip(baseline.stretches, baseline.beside, strict=True):
        faults.setdefault(stretch.run.run.name, {})[stretch.side] = fault
    found: dict[str, SmoothRun] = {}
    for stretch in baseline.stretches:
        run, of_run = stretch.run, faults[stretch.run.run.name]
        shafts = PerShaft(*(replace(shaft, fault=of_run.get(side)) for side, shaft in run.shafts.items()))
        found[run.run.name] = replace(run, shafts=shafts)
    return replace(baseline, stretches=tuple(replace(s, run=found[s.run.run.name]) for s in baseline.stretches))


def _without_noise(baseline: MotionBaseline, run: SmoothRun, places: list[int]) -> SmoothRun:
    """A run less the noise that the residuals of its stretches show."""
    sides = [baseline.stretches[place].side for place in places]
    residual = np.zeros((len(places), len(run)))
    for row, place in zip(residual, places, strict=True):
        row[baseline.stretches[place].rows] = baseline.left(place)
    frequency = np.fft.rfftfreq(2 * len(run), 1.0 / run.row_rate)
    rate = np.asarray(1j * REVOLUTION * frequency, dtype=np.complex128)
    mixing = _mixing(baseline, run, sides, rate)
    density = np.array(
        [run.shafts[side].density for side in SIDES] + [run.shafts[side].angle_density for side in SIDES]
    )
    weighted = density[:, None] * mixing.conj().transpose(2, 1, 0)
    inverse = np.linalg.inv(mixing.transpose(2, 0, 1) @ weighted)
    spectrum = np.fft.rfft(residual, 2 * len(run))
    passed = _response(run.weights, np.asarray(frequency / run.fine_rate))
    noise = (weighted @ inverse @ spectrum.T[:, :, None])[:, :, 0].T / np.where(passed > PASSING, passed, np.inf)

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


def _mixing(baseline: MotionBaseline, run: SmoothRun, sides: list[str], rate: Spectrum) -> Spectrum:
    """What each noise (torques, then angles) adds to each residual, by frequency (r, 4, f)."""
    sheet, values = baseline.sheet, baseline.values
    peak = float(values[sheet.at("pull_out")])
    mixing = np.zeros((len(sides), 2 * len(SIDES), len(rate)), dtype=np.complex128)
    for row, side in enumerate(sides):
        at = SIDES.index(side)
        mixing[row, at] = 1.0
        mixing[row, 2 + at] = -float(values[sheet.at(f"inertia_{side}")]) * rate**2
        if run.run.coupled:
            for other in SIDES:
                spring = peak * sheet.poles[side] * sheet.poles[other]
                mixing[row, 2 + SIDES.index(other)] -= spring
    return mixing
