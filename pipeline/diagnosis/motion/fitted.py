"""The constants of a bench fitted to its runs, in the noise that these show, alone and beside mechanisms."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline, fit_baseline, start_baseline
from pmg.pipeline.diagnosis.motion.candidates.beside import (
    Heard,
    amounts_of,
    columns_with_known,
    lags_of,
    start_of,
    terms_of,
    torque_of_fits,
    with_skews,
)
from pmg.pipeline.diagnosis.motion.constants import sheet_of, start_name
from pmg.pipeline.diagnosis.motion.families import slow_structures, zeros_in_time
from pmg.pipeline.diagnosis.motion.loss_curve import falls_of
from pmg.pipeline.diagnosis.motion.noise.aligned_turns import turn_origins
from pmg.pipeline.diagnosis.motion.noise.filtered_torque import with_noise_of_band
from pmg.pipeline.diagnosis.motion.noise.row_noise import between_runs, row_noise
from pmg.pipeline.diagnosis.motion.noise.shown import slow_noise_of
from pmg.pipeline.diagnosis.motion.noise.steps_anew import COUNTED, off_by_steps, widened
from pmg.pipeline.diagnosis.motion.regressors import with_faults, with_instruments
from pmg.pipeline.diagnosis.motion.rows import STANDING, STANDSTILL, stretches_of
from pmg.pipeline.diagnosis.motion.view import views_of
from pmg.pipeline.motion.senses import check_senses
from pmg.pipeline.motion.smooth import smooth
from pmg.sim.errors import FitError
from pmg.sim.shafts import SIDES, per_shaft

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pmg.pipeline.diagnosis.balance.fitting import TermFit
    from pmg.pipeline.diagnosis.motion.constants import DataSheet
    from pmg.pipeline.diagnosis.motion.noise.row_noise import RowNoise
    from pmg.pipeline.diagnosis.motion.noise.turn_origins import TurnOrigins
    from pmg.pipeline.diagnosis.motion.rows import RotorRows
    from pmg.pipeline.motion.run import MovingRun
    from pmg.sim.bench import BenchParameters
    from pmg.sim.shafts import PerShaft
    from pmg.sim.signals import Array

CLEANINGS = 2
"""Times the constants are fitted, each time with columns freed from the noise that the fit before showed."""

DENSITY_DOUBT = 0.03
"""Relative standard uncertainty of the noise of a torque over that of an angle, in the band of the rows: 2 % of either
from a run of half a minute. Of steps that fold into it unevenly while a speed is held, no constant is surer than these
leave it."""

STIFFER = 0.02 / math.sqrt(3.0)
"""Standard uncertainty of the part by which the damping of a coupling makes it stiffer in the band: at most the square
of damping times frequency over stiffness, which at 20 Hz is 0.15 squared for 3 N m s/rad on 2500 N m/rad."""

HELD = 1e-3
"""Factor on the standard uncertainty of what is held."""

POLE_STEP = 1e-4
"""Change of the pole angle over which the stiffness of a mechanism is taken [rad]."""

BENDING = ("inertia", "compliance", "coupling_loss", "pull_out", "skew")
"""Constants by which rows are no straight lines, as their names begin."""


def fit_constants(
    runs: tuple[MovingRun, ...], bench: BenchParameters, known: Mapping[str, tuple[float, float]] | None = None
) -> tuple[MotionBaseline, Array, list[RowNoise]]:
    """The baseline of some runs, the covariance (k, k) of its constants, and the noise of each stretch.

    Wander and ripple are what the residuals of a first fit show beside all that may explain them, zeros that follow a
    smooth curve of time among it: what moves over the campaign is no wander, and is not to be taken for one because
    constants took up a part of it.
    Runs whose counters begin their turns anew are aligned by waves of a turn that they show, and fitted again. No
    constant is surer than steps and jitter of the encoders leave it.
    """
    before, covariance, noise = _fit_with_noise(runs, bench, known or {})
    aligned: tuple[TurnOrigins, ...] = ()
    while origins := turn_origins(before, noise[0].slow_noise, aligned):
        runs, aligned = tuple(map(origins.of, runs)), (*aligned, origins)
        before, covariance, noise = _fit_with_noise(runs, bench, known or {})
    before = replace(before, origins=aligned)
    doubted = _with_denser_torque(before, noise) - before.values
    stiffer = np.zeros(len(before.sheet))
    for at in (before.sheet.at(f"compliance_{side}") for side in SIDES):
        stiffer[at] = STIFFER * before.values[at]
    covariance = _with_wander_and_steps(before, covariance, noise)
    return before, covariance + np.outer(doubted, doubted) + np.diag(stiffer**2), noise


def _fit_with_noise(
    runs: tuple[MovingRun, ...], bench: BenchParameters, known: Mapping[str, tuple[float, float]]
) -> tuple[MotionBaseline, Array, list[RowNoise]]:
    """The constants by the rows alone, their covariance (k, k), and the noise that a first fit shows.

    A loss curve that falls plainly, wander and steps of the encoders allowed for, is fitted again as one that should
    rise.
    """
    start = _start(runs, bench, known)
    noise = [row_noise(start, place) for place in range(len(start.stretches))]
    rough, _ = fit_beside(start, noise, ())
    noise = noise_beside(rough, noise)
    found, covariance = fit_beside(rough, noise, ())
    at_most = _fastest_in_neutral(found.stretches)
    if falls_of(found.sheet, found.values, covariance, at_most):
        wider = _with_wander_and_steps(found, covariance, noise)
        falls = falls_of(found.sheet, found.values, wider, at_most)
        found, covariance = fit_beside(replace(found, sheet=replace(found.sheet, sums=falls)), noise, ())
    return found, covariance, noise


def _fastest_in_neutral(stretches: tuple[RotorRows, ...]) -> PerShaft[float]:
    """Largest speed of each rotor where the gear does not load it [rad/s]."""

    def of(side: str) -> float:
        turning = (s.shaft.speed for s in stretches if s.side == side and not (s.at_rest or s.coupled))
        return max((float(np.abs(speed).max()) for speed in turning), default=0.0)

    return per_shaft(of)


def _with_wander_and_steps(fitted: MotionBaseline, covariance: Array, noise: list[RowNoise]) -> Array:
    """The covariance (k, k) of the constants with wander that goes on from run to run, and with steps as they are.

    The fit takes each run to wander by itself, and steps of the encoders for white noise. Steps of one run are at
    other places than those of the next.
    """
    seen, moved = [], dict.fromkeys((s.run.run.name for s in fitted.stretches), np.zeros((len(fitted.sheet), COUNTED)))
    for place, (each, off) in enumerate(zip(noise, off_by_steps(fitted, jitters=True), strict=True)):
        pull = covariance @ each.white(fitted.clean.columns(place)).T
        seen.append(pull @ each.white(each.lines))
        name = fitted.stretches[place].run.run.name
        moved[name] = moved[name] + pull @ each.white(off)
    least = np.sum([np.mean(of_run**2, axis=1) for of_run in moved.values()], axis=0)
    return widened(covariance, least) + between_runs(noise, seen)


def _with_denser_torque(fitted: MotionBaseline, noise: list[RowNoise]) -> Array:
    """The constants (k,) if the noise of the torques were denser by `DENSITY_DOUBT`, beside that of the angles.

    What is taken out of the columns then is another part of what the balance shows.
    """

    def denser(stretch: RotorRows) -> RotorRows:
        shafts = stretch.run.shafts.map(lambda shaft: replace(shaft, density=(1.0 + DENSITY_DOUBT) * shaft.density))
        return replace(stretch, run=replace(stretch.run, shafts=shafts))

    other = with_instruments(replace(fitted, stretches=tuple(map(denser, fitted.stretches))))
    found, _ = fit_baseline(replace(fitted, instruments=other.instruments), _whitener(noise))
    return found.values


def noise_beside(fitted: MotionBaseline, noise: list[RowNoise]) -> list[RowNoise]:
    """The noise of each stretch, with what a fitted baseline leaves beside its constants, drift and slow structures."""
    explained, views = [], views_of(fitted.clean)
    others = zip(zeros_in_time(views), slow_structures(views), strict=True)
    for place, (stretch, of_stretch) in enumerate(zip(fitted.stretches, others, strict=True)):
        explained.append(np.hstack([fitted.clean.columns(place), stretch.of_rows(np.hstack(of_stretch))]))
    left = [fitted.left(place) for place in range(len(fitted.stretches))]
    slow_noise = slow_noise_of(fitted.stretches, noise, left, explained)
    return [row_noise(fitted, place, slow_noise) for place in range(len(fitted.stretches))]


def _start(
    runs: tuple[MovingRun, ...], bench: BenchParameters, known: Mapping[str, tuple[float, float]]
) -> MotionBaseline:
    gears = {run.gear for run in runs if run.manoeuvre.moves}
    if len(gears) != 1:
        came = ", ".join(f"gear {gear}" for gear in sorted(gears)) or "no run"
        raise FitError("diagnosis in motion", came, "runs of one gear", "Diagnose each gear by itself.")
    smoothed = with_noise_of_band(tuple(smooth(run) for run in runs))
    sheet = sheet_of(bench, gears.pop(), tuple(run.name for run in runs if run.coupled)).with_known(known)
    stretches = stretches_of(smoothed)
    if all(stretch.at_rest for stretch in stretches):
        came, expected = "no shaft that turns", f"more than {STANDSTILL:g} rad/s for {STANDING:g} s somewhere"
        raise FitError("diagnosis in motion", came, expected, "Diagnose runs that move.")
    check_senses(smoothed, bench.transducers.map(lambda transducer: float(transducer.nominal_torque)))
    return start_baseline(sheet, stretches)


def fit_beside(start: MotionBaseline, noise: list[RowNoise], fits: tuple[TermFit, ...]) -> tuple[MotionBaseline, Array]:
    """The constants fitted beside some mechanisms, their shapes kept, and the covariance of all that is fitted.

    Parameters
    ----------
    start : MotionBaseline
        Where the search starts.
    noise : list of RowNoise
        Of each stretch.
    fits : tuple of TermFit
        The mechanisms; their amplitudes are fitted anew.
    """

    def extra(clean: MotionBaseline) -> list[Array]:
        return [columns_with_known(view, fits) for view in views_of(clean)]

    white, (_, spread) = _whitener(noise), start_of(fits, start.sheet)
    found, covariance = start, np.zeros((0, 0))
    if not start.instruments:
        found = _with_masses_of_sheet(_apart(start, fits), start.sheet, white)
    for _ in range(CLEANINGS if fits or not start.instruments else 1):
        apart = _apart(replace(found, sheet=start.sheet), fits)
        found, covariance = fit_baseline(apart, white, extra if fits else None, spread)
        torque = partial(torque_of_fits, fits=fits, amounts=(amounts := amounts_of(found, fits)))
        found = replace(with_skews(found, fits), lags=lags_of(fits, amounts))
        if any(term.bends_spring for term in terms_of(fits)):
            found = replace(found, stiffer=_stiffer(found.clean, torque))
        if any(term.of_transducer for term in terms_of(fits)):
            found = with_faults(found, torque(found.clean, which=lambda term: term.of_transducer))
        noisy, clean = MotionBaseline(found.sheet, found.values, found.stretches), found.clean
        noisy_laws = any(term.of_noisy_angles for term in terms_of(fits))
        of_angles = partial(torque, which=lambda term: term.of_noisy_angles)
        if noisy_laws:
            shown, meant = of_angles(noisy), of_angles(clean)
            found = replace(found, of_noise=tuple(map(np.subtract, shown, meant)))
        if any(term.hears for term in terms_of(fits)):
            heard = torque(noisy, which=lambda term: term.hears is not None)
            others = torque(clean, which=lambda term: term.hears is None)
            found = with_instruments(found, tuple(map(np.add, heard, others)), Heard(fits, amounts))
        else:
            found = with_instruments(found)
        if noisy_laws:
            found = _with_noise_of_angles(found, shown, meant, of_angles(found.clean))
    return replace(found, sheet=start.sheet), covariance


def _stiffer(clean: MotionBaseline, torque: Callable[..., tuple[Array, ...]]) -> tuple[float, ...]:
    """What mechanisms add to the magnetic spring on each stretch, on average [N m/rad]; `torque` gives theirs."""
    moved = clean.values.copy()
    moved[[clean.sheet.at(start_name(s.run.run.name)) for s in clean.stretches if s.coupled]] += POLE_STEP
    here, ahead = (torque(s, which=lambda term: term.bends_spring) for s in (clean, replace(clean, values=moved)))
    return tuple(float(np.mean(a - b)) / POLE_STEP for a, b in zip(ahead, here, strict=True))


def _with_noise_of_angles(
    found: MotionBaseline, shown: tuple[Array, ...], before: tuple[Array, ...], now: tuple[Array, ...]
) -> MotionBaseline:
    """A baseline whose mechanisms are made of signals freed from noise anew; what is left of its rows stays as it is.

    `shown` is the torque (n,) of those `of_noisy_angles` with all noise, `before` and `now` with what the signals had
    and have of it.
    """
    beside = (b + n - m for b, n, m in zip(found.beside, now, before, strict=True))
    return replace(found, beside=tuple(beside), of_noise=tuple(map(np.subtract, shown, now)))


def _whitener(noise: list[RowNoise]) -> Callable[[int, Array], Array]:
    def white(place: int, columns: Array) -> Array:
        return noise[place].white(columns)

    return white


def _with_masses_of_sheet(
    start: MotionBaseline, sheet: DataSheet, white: Callable[[int, Array], Array]
) -> MotionBaseline:
    """A baseline with instruments, its inertias and springs still those of the data sheet.

    Where a campaign hardly accelerates, noise is most of what an acceleration shows, and an inertia fitted to it is too
    small by as much. And beside an inertia that is held and wrong, no other constant that bends the rows has a meaning.
    """
    found, _ = fit_baseline(replace(start, sheet=_held(start.sheet, BENDING)), white)
    return with_instruments(replace(found, sheet=sheet))


def _held(sheet: DataSheet, names: tuple[str, ...]) -> DataSheet:
    """A data sheet that hardly lets constants move whose names begin so."""
    return replace(
        sheet,
        constants=tuple(
            replace(constant, spread=HELD * constant.spread) if constant.name.startswith(names) else constant
            for constant in sheet.constants
        ),
    )


def _apart(start: MotionBaseline, fits: tuple[TermFit, ...]) -> MotionBaseline:
    """Baseline to start from, a faulty transducer's skew set to its data sheet, so that the fit can separate the two.

    Beside a delay the skew is held there: it multiplies the slope of the measured torque and of its noise, and together
    with a longer delay it would fit better than the true one alone. Beside a lag that is no delay it is an amplitude.
    """
    values = start.values.copy()
    late = [term for term in terms_of(fits) if term.comes_late]
    held = tuple(name for term in late if term.whole for name in term.mimicked_by)
    for term in terms_of(fits):
        if term.hears or term.comes_late:
            for at in (start.sheet.at(f"skew_{side}") for side in term.sides):
                values[at] = start.sheet.expected[at]
    amounts, _ = start_of(fits, start.sheet)
    return replace(start, sheet=_held(start.sheet, held), values=values, amounts=amounts, lags=lags_of(fits))
