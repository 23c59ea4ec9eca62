"""Signals freed from the noise that a balance shows: what is left in them says nothing of the residual, at any time."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from tests.diagnosis.test_motion_columns import short_baseline
from tests.slow import slow

from pmg.pipeline.diagnosis.balance.fitting import TermFit
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.motion.baseline import MotionBaseline
from pmg.pipeline.diagnosis.motion.candidates.beside import torque_of_fits
from pmg.pipeline.diagnosis.motion.candidates.library import library
from pmg.pipeline.diagnosis.motion.decide import diagnose_motion
from pmg.pipeline.diagnosis.motion.fitted import _stiffer
from pmg.pipeline.diagnosis.motion.regressors import REGULAR, _factor, _of_noises, _taps, with_instruments
from pmg.pipeline.motion.angle_noise import EVEN, AngleNoise, NoiseCourse
from pmg.pipeline.motion.quantisation import NO_ERROR
from pmg.pipeline.motion.smooth import PER_ROW, SmoothRun, SmoothShaft, derivative
from pmg.pipeline.trials.motion.nature import measure_motion_case
from pmg.pipeline.trials.score.case_list import draw_motion_lots
from pmg.sim.bench import load_bench
from pmg.sim.shafts import PerShaft, per_shaft
from pmg.sim.signals import Array

OF_TORQUE, OF_ANGLE, DRAWS = 4e-7, 6e-10, 60
"""Densities of made noise [(N m)2/Hz, rad2/Hz], and how often it is drawn."""


@pytest.fixture(scope="module")
def baseline() -> MotionBaseline:
    """Of a short synthetic campaign, both shafts in neutral and engaged."""
    return short_baseline()


def _swell(run: SmoothRun) -> Array:
    """Size of the noise of an angle: large in every other second, and small in between (n,)."""
    return np.where(np.mod(run.time, 2.0) < 1.0, 1.35, 0.42)


def _noisy(baseline: MotionBaseline, place: int, rng: np.random.Generator, *, told: bool) -> MotionBaseline:
    """A baseline of one stretch whose residual is made noise alone; whether the course of its size is known."""
    stretch = baseline.stretches[place]
    run, size, readings = stretch.run, _swell(stretch.run), {}
    course = NoiseCourse(run.time, size, size, np.zeros((len(run.time), 0))) if told else EVEN

    def shaft(side: str) -> SmoothShaft:
        own, white = run.shafts[side], rng.standard_normal((2, len(run.time)))
        torque, angle = np.sqrt(0.5 * run.fine_rate * np.array([[OF_TORQUE], [OF_ANGLE]])) * white
        readings[side], angle = torque, size * angle
        speed = derivative(angle, run.fine_rate)
        slope = derivative(torque, run.fine_rate)
        return replace(
            own,
            torque=own.torque + torque,
            torque_rate=own.torque_rate + slope,
            torque_curvature=own.torque_curvature + derivative(slope, run.fine_rate),
            angle=own.angle + angle,
            speed=own.speed + speed,
            acceleration=own.acceleration + derivative(speed, run.fine_rate),
            density=OF_TORQUE,
            angle_noise=AngleNoise(OF_ANGLE, OF_ANGLE, NO_ERROR, course),
        )

    shafts, measured = per_shaft(shaft), dict(run.measured.items())
    reading = np.full(len(run), np.nan)
    reading[stretch.rows] = baseline.predicted(place) + stretch.of_rows(readings[stretch.side])
    measured[stretch.side] = reading
    noisy = replace(run, shafts=shafts, measured=PerShaft(**measured), common=0.0)
    return MotionBaseline(baseline.sheet, baseline.values, (replace(stretch, run=noisy),))


@pytest.mark.parametrize(("coupled", "louder"), [(True, 1.0), (False, 1e4)])
def test_both_balances_of_a_run_have_the_covariance_that_its_noises_make(
    baseline: MotionBaseline, louder: float, *, coupled: bool
) -> None:
    """Row by row of both rotors, against sums over all fine samples; a row that was lost weighs nothing.

    The angle of one may be much noisier than that of the other, whose rows are as exact nevertheless.
    """
    places = [k for k, each in enumerate(baseline.stretches) if each.coupled == coupled and not each.at_rest][:2]
    run = baseline.stretches[places[0]].run
    assert {baseline.stretches[place].run.run.name for place in places} == {run.run.name}
    noise = run.shafts.ring.angle_noise
    ring = replace(run.shafts.ring, angle_noise=replace(noise, density=louder * noise.density))
    run = replace(run, shafts=PerShaft(run.shafts.sun, ring))
    common = 0.5 * np.sqrt(run.shafts.sun.angle_noise.density * run.shafts.ring.angle_noise.density)
    run = replace(run, common=float(common))
    shows, covariance = _taps(baseline, run, places, None), _of_noises(run)
    known, rows, n = np.ones((len(run), 2), dtype=np.bool_), 40, len(run.time)
    known[7, 1] = False
    factor = _factor(run, shows, covariance, known)
    half, first = shows.shape[2] // 2, len(run.weights) // 2
    whole = np.zeros((rows, 2, len(shows[0]), n + 2 * half))
    for row in range(rows):
        at = first + PER_ROW * row
        whole[row, :, :, at : at + 2 * half + 1] = shows
    power = {pair: np.pad(of, half, mode="edge") for pair, of in covariance.items()}
    expected = sum(
        np.einsum("iat,t,jbt->iajb", whole[:, :, one], of, whole[:, :, another]) for (one, another), of in power.items()
    ).reshape(2 * rows, 2 * rows)
    lower = np.sum([np.diag(of[: 2 * rows - lag], -lag) for lag, of in enumerate(factor[: 2 * rows])], axis=0)
    found = lower @ lower.T
    of_lost = 2 * 7 + 1
    assert found[of_lost, of_lost] > 1e5 * expected.max()
    others = np.delete(np.arange(2 * rows), of_lost)
    size = np.sqrt(np.diag(expected)[others])
    np.testing.assert_allclose(
        found[np.ix_(others, others)] / np.outer(size, size),
        expected[np.ix_(others, others)] / np.outer(size, size),
        atol=3.0 * REGULAR,
    )


def test_a_mechanism_makes_the_magnetic_spring_stiffer_by_its_slope(baseline: MotionBaseline) -> None:
    """In engaged stretches alone; a third wave of the map is three times as steep as it is high."""
    (term,) = (term for term in library() if term.key == "torque_map_harmonic/both/")
    fit = TermFit(term, 1.0, 1.0, np.zeros(1), (), np.array([0.1]), 0.0)
    torque = partial(torque_of_fits, fits=(fit,), amounts=[fit.amplitudes])
    for stretch, state, more in zip(baseline.stretches, baseline.states, _stiffer(baseline.clean, torque), strict=True):
        poles = baseline.sheet.poles[stretch.side]
        slope = 0.3 * poles * float(np.mean(np.cos(3.0 * state.pole_angle)))
        assert more == pytest.approx(slope if stretch.coupled else 0.0, rel=1e-3, abs=1e-9)


@slow
def test_a_strong_wave_of_the_map_is_named_though_its_torque_holds_noise_of_the_angles() -> None:
    """A trial campaign with a third wave of more than a quarter of the pull-out torque."""
    lot = draw_motion_lots(240, 20261130710)[48]
    case = lot.draw()
    (effect,) = case.truth["effects"]
    assert (effect["id"], effect["knobs"]["law"]) == ("torque_map_harmonic", "third")
    runs = tuple(measure_motion_case(case, lot.rng("measure")))
    found = diagnose_motion(case.campaign, runs, load_bench(), np.random.default_rng(0))
    assert found.verdict is Verdict.NAMED
    assert found.naming is not None
    assert [fit.identifier for fit in found.naming.best.fits] == ["torque_map_harmonic"]
    assert float(found.sizes[0][0]) == pytest.approx(effect["size"], rel=0.1)


@pytest.mark.parametrize("coupled", [False, True])
def test_what_is_left_in_an_acceleration_follows_no_residual_while_its_noise_changes(
    baseline: MotionBaseline, *, coupled: bool
) -> None:
    """In the loud seconds and in the quiet ones; with one size for the whole run both are wrong."""
    rng = np.random.default_rng(7)
    place = next(k for k, each in enumerate(baseline.stretches) if each.coupled == coupled and not each.at_rest)
    stretch = baseline.stretches[place]
    true = stretch.of_rows(stretch.shaft.acceleration)
    loud = stretch.of_rows(_swell(stretch.run))
    follows = {}
    for told in (True, False):
        products = []
        for _ in range(DRAWS):
            noisy = _noisy(baseline, place, rng, told=told)
            (cleaned,) = with_instruments(noisy).instruments
            off, residual = cleaned.of_rows(cleaned.shaft.acceleration) - true, noisy.left(0)
            products.append([np.corrcoef(off[which], residual[which])[0, 1] for which in (loud > 1.3, loud < 0.5)])
        follows[told] = np.mean(products, axis=0)
    assert np.all(np.abs(follows[True]) < 0.1)
    assert np.max(np.abs(follows[False])) > 0.15
