"""Laws of runs in motion on signals written down here: waves that samples cannot hold, held torques, drifting zeros."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.diagnosis.test_motion import RATE, _campaign, _dither, _run, _with_torque

from pmg.pipeline.diagnosis.balance.catalogue import TermCatalogue
from pmg.pipeline.diagnosis.balance.fitting import Tabled, TermProblem
from pmg.pipeline.diagnosis.engine.adequacy import Remainder
from pmg.pipeline.diagnosis.engine.conclusion import Conclusion, probabilities
from pmg.pipeline.diagnosis.engine.naming import name_candidates
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.motion.candidates.coupling_terms import _crossing
from pmg.pipeline.diagnosis.motion.candidates.late_terms import _unheld
from pmg.pipeline.diagnosis.motion.candidates.terms import signed, stack, term
from pmg.pipeline.diagnosis.motion.constants import FORM_SPEEDS, sheet_of
from pmg.pipeline.diagnosis.motion.decide import diagnose_motion
from pmg.pipeline.diagnosis.motion.fitted import fit_constants
from pmg.pipeline.diagnosis.motion.loss_curve import BETWEEN, loss_curve
from pmg.pipeline.diagnosis.motion.rows import STANDING, STANDSTILL, stretches_of
from pmg.pipeline.diagnosis.motion.view import EVERY, RotorView, lagging, stopping, waves_of
from pmg.pipeline.motion.run import MovingRun
from pmg.pipeline.motion.smooth import FINE_RATE, fine_response, smooth
from pmg.pipeline.recording.run_records import Manoeuvre
from pmg.sim.bench import load_bench
from pmg.sim.mechanisms.base import Component


def _showing(run: MovingRun, torque: np.ndarray) -> MovingRun:
    """The same run with another torque of the sun."""
    return _with_torque(run, torque - run.torque.sun)


@given(st.floats(1.0, 150.0), st.floats(0.0, 6.0))
@settings(max_examples=25)
def test_the_filter_before_the_fine_samples_lets_through_what_is_said(frequency: float, phase: float) -> None:
    t = np.arange(4000) / RATE
    run = _run(1, Manoeuvre.DITHER, _dither(60.0, 4.0), np.random.default_rng(1))
    shown = _showing(run, torque=np.sin(2.0 * np.pi * frequency * t + phase))
    seen = smooth(shown).shafts.sun.torque
    wave = np.sin(2.0 * np.pi * frequency * smooth(shown).time + phase)
    assert np.abs(seen - fine_response(RATE, np.array([frequency])) * wave).max() < 0.01


def test_a_wave_that_is_too_fast_for_the_samples_is_none() -> None:
    """At 30 turns a second ten periods a turn are 300 Hz, which samples at 250 Hz would show as 50 Hz."""
    turned = 2.0 * np.pi * 30.0 * np.arange(500) / FINE_RATE
    for speed, largest in ((2.0 * np.pi * 30.0, 0.0), (2.0 * np.pi * 3.0, 1.0)):
        shaft = SimpleNamespace(speed=np.full(500, speed), angle=turned * speed / (2.0 * np.pi * 30.0))
        run = SimpleNamespace(run=SimpleNamespace(rate=RATE), shafts={"sun": shaft})
        state: Any = SimpleNamespace(stretch=SimpleNamespace(run=run))
        history: Any = None
        waves = waves_of(RotorView(state, history), "sun", (10,))
        assert waves.shape == (500, 2)
        assert np.abs(waves).max() == pytest.approx(largest, abs=0.02)


@pytest.mark.parametrize("held", [0.006, 0.012])
def test_a_torque_that_is_renewed_now_and_then_is_found_again(held: float) -> None:
    """Shown is the value at the last renewal, in the mean half a period old; the column makes up for both."""
    fine = np.arange(0.0, 4.0, 1e-4)

    def true(t: np.ndarray) -> np.ndarray:
        return 0.3 * np.sin(2.0 * np.pi * 3.0 * t) + 0.2 * np.sin(2.0 * np.pi * 11.0 * t + 1.0)

    shown = true(held * np.floor(fine / held))
    run = smooth(_with_rate(shown, 1e4))
    shaft = run.shafts.sun
    stretch = SimpleNamespace(run=run)
    view = cast("RotorView", SimpleNamespace(shaft=shaft, state=SimpleNamespace(stretch=stretch)))
    delayed = shaft.torque - np.interp(run.time + 0.5 * held, run.time, shaft.torque)
    off = shaft.torque - true(run.time)
    whole, plain, sharp = (
        np.std(run.rows(off - column)[5:-5]) for column in (0.0 * off, delayed, _unheld(view, 0.5 * held))
    )
    assert sharp < 0.05 * whole
    assert sharp < 0.9 * plain


def _with_rate(torque: np.ndarray, rate: float) -> MovingRun:
    run = _run(1, Manoeuvre.DITHER, np.full(len(torque), 20.0), np.random.default_rng(1))
    return replace(_showing(run, torque), rate=rate)


def test_a_zero_that_drifts_over_a_campaign_is_no_wander() -> None:
    """The wander of the readings is found as if the zero stood still, though constants take up a part of its way."""
    wanders = []
    for drift in (0.0, 0.02):
        runs = tuple(
            _with_torque(run, np.full(len(run.torque.sun), drift * k / 5.0)) for k, run in enumerate(_campaign(31))
        )
        _, _, noise = fit_constants(runs, load_bench())
        wanders.append(noise[0].slow_noise.wander.sun.size)
    assert wanders[1] < 1.5 * wanders[0]


def test_a_shaft_that_creeps_gives_no_rows_and_a_reversal_does() -> None:
    seconds = np.arange(6000) / RATE
    creeps = np.where(seconds < 2.0, 0.5 * STANDSTILL, 40.0 * np.sin(2.0 * np.pi * 0.5 * (seconds - 2.0)))
    (stretch,) = stretches_of((smooth(_run(1, Manoeuvre.DITHER, creeps, np.random.default_rng(1))),))
    time = stretch.run.row_time
    assert not stretch.rows[time < 2.0 - STANDING].any()
    assert stretch.rows[time > 2.0 + STANDING].all()


def _named(
    part: float,
    form_margin: float,
    spare: int = 0,
    *,
    size: float = 30.0,
    beside: float = 0.0,
    entry: float = math.inf,
    tells_weak: bool = False,
) -> Any:  # noqa: ANN401 - a naming
    """Two causes whose columns agree but for a part, in rows that hold the first, by an error of form of some size.

    The second has spare parameters that explain nothing; `beside` is what the rows hold of that part.
    """

    class Catalogue(TermCatalogue):
        pass

    Catalogue.form_margin, Catalogue.further_entry, Catalogue.tells_weak = form_margin, entry, tells_weak
    rows = np.eye(60)
    terms = {
        name: term(
            name,
            name,
            "x",
            signed("size", *more, unit="1", most=100.0),
            lambda *_: stack(np.zeros(1)),
            component=Component("sun_coupling"),
            shaft="sun",
        )
        for name, more in (("first", ()), ("second", tuple(map(str, range(spare)))))
    }
    other = math.sqrt(1.0 - part) * rows[:, 0] + math.sqrt(part) * rows[:, 1]
    columns = {"first": rows[:, :1], "second": np.column_stack([other, rows[:, 2 : 2 + spare]])}
    tables = {
        terms[name].key: Tabled(terms[name], np.array([math.nan]), column[:, None]) for name, column in columns.items()
    }
    left = np.r_[size, np.zeros(1 + spare), np.random.default_rng(3).standard_normal(59 - 1 - spare)]
    left[1] += beside
    problem = TermProblem(np.zeros((60, 0)), left, lambda t, _: columns[t.identifier], tables)
    return name_candidates(problem, Catalogue(), lambda _: Remainder(0.5, 0.0, 10.0))


def test_a_further_cause_enters_where_no_structure_is_seen_if_it_is_plain() -> None:
    """The first explains 900; of what joins it, a twentieth of that and the entry are asked for."""
    assert _named(1.0, 0.0, beside=12.0, entry=40.0).best.ids == {"first", "second"}
    assert _named(1.0, 0.0, beside=12.0).best.ids == {"first"}
    assert _named(1.0, 0.0, beside=6.0, entry=20.0).best.ids == {"first"}
    assert _named(1.0, 0.0, beside=12.0, entry=150.0).best.ids == {"first"}
    assert _named(1.0 / 60.0, 0.0, entry=40.0).best.ids == {"first"}


def test_a_pair_that_entered_is_not_told_as_a_weak_single() -> None:
    weak = _named(1.0, 0.0, size=7.0, beside=7.0, entry=10.0, tells_weak=True)
    assert weak.best.ids == {"first", "second"}
    assert not weak.weak
    assert [each.ids for each in _named(1.0, 0.0, size=7.0, tells_weak=True).weak] == [{"first"}]


def test_look_alikes_within_an_error_of_form_are_told_together() -> None:
    """Of an evidence of 900, one part in sixty is more than the margin and less than two hundredths."""
    strict, lenient = _named(1.0 / 60.0, 0.0), _named(1.0 / 60.0, 0.02)
    assert strict.best.ids == lenient.best.ids == {"first"}
    assert [rival.ids for rival in strict.rivals] == []
    assert [rival.ids for rival in lenient.rivals] == [{"second"}]
    assert [rival.ids for rival in _named(0.1, 0.02).rivals] == []
    first, second = probabilities(Conclusion(verdict=Verdict.AMBIGUOUS, naming=lenient))
    assert 0.02 < second < 0.5 < first


def test_more_parameters_that_explain_no_more_are_no_look_alike() -> None:
    plain, richer = _named(0.0, 0.02), _named(0.0, 0.02, spare=4)
    assert [rival.ids for rival in plain.rivals] == [{"second"}]
    assert richer.best.ids == {"first"}
    assert [rival.ids for rival in richer.rivals] == []


@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=60), st.floats(0.01, 0.5))
def test_a_rotor_crosses_its_play_from_where_it_lay_to_where_it_lies(torques: list[float], contact: float) -> None:
    torque = np.array(torques)
    half = _crossing(torque, contact, 1.0)
    lies = np.abs(torque) > contact
    np.testing.assert_array_equal(half[lies], 0.5 * np.sign(torque[lies]))
    assert (np.abs(half) <= 0.5).all()
    for one, other in itertools.pairwise(np.flatnonzero(lies)):
        way = np.diff(half[one : other + 1])
        assert (way * (np.sign(torque[other]) - np.sign(torque[one])) >= 0.0).all()
        assert np.abs(np.diff(half[one + 1 : other], n=3)).max(initial=0.0) < 1e-9, "evenly accelerated"


@given(st.floats(0.05, 0.4), st.floats(0.5, 3.0), st.floats(0.0, 0.3))
def test_a_play_changes_evenly_with_the_torque_at_which_a_rotor_lies(contact: float, rate: float, mean: float) -> None:
    torque = np.sin(rate * np.arange(0.0, 10.0, 1e-3)) + mean
    change = np.abs(_crossing(torque, contact + 1e-6, 1.0) - _crossing(torque, contact, 1.0)).max()
    assert 0.0 < change < 1e-4, "no step from one sample to the next"


def test_a_loss_curve_is_less_sure_between_the_speeds_at_which_it_is_fitted() -> None:
    sheet = sheet_of(load_bench(), 1, ())
    known = np.zeros((len(sheet), len(sheet)))
    at, between = np.array(FORM_SPEEDS), np.sqrt(np.array(FORM_SPEEDS[:-1]) * np.array(FORM_SPEEDS[1:]))
    assert loss_curve(sheet, sheet.expected, known, "sun", at)[1] == pytest.approx(0.0, abs=1e-9)
    halfway = loss_curve(sheet, sheet.expected, known, "sun", between)[1]
    assert halfway == pytest.approx(np.array(BETWEEN), rel=1e-6)


@given(st.floats(0.003, 3.0), st.integers(2, 400), st.integers(0, 99))
def test_a_bristle_and_a_stop_follow_their_laws_step_by_step(over: float, count: int, seed: int) -> None:
    angle = np.cumsum(0.1 * np.random.default_rng(seed).standard_normal(count))
    bristle, stop, bristles, stops = 0.0, 0.0, [], []
    for step in np.diff(angle[::EVERY], prepend=angle[0]) / over:
        sense = np.sign(step)
        bristle = sense + (bristle - sense) * np.exp(-abs(step)) if sense else bristle
        stop = min(max(stop + step, -1.0), 1.0)
        bristles.append(bristle)
        stops.append(stop)
    np.testing.assert_allclose(lagging(angle, over)[::EVERY], bristles, atol=1e-12)
    np.testing.assert_allclose(stopping(angle, over)[::EVERY], stops, atol=1e-12)


@pytest.mark.parametrize(("order", "second"), [(7, 0.0), (10, 0.0), (12, 0.0), (14, 0.4)])
def test_cogging_is_named_with_its_order_whether_poles_have_it_or_not(order: int, second: float) -> None:
    def cogging(angle: np.ndarray) -> np.ndarray:
        return np.asarray(0.03 * (np.sin(order * angle + 1.0) + second * np.sin(2 * order * angle)))

    runs = tuple(_with_torque(run, cogging(run.angle.sun) * run.turns.sun) for run in _campaign(33))
    found = diagnose_motion("cogging", runs, load_bench(), np.random.default_rng(0))
    assert found.verdict is Verdict.NAMED
    assert found.naming is not None
    (fit,) = found.naming.best.fits
    assert (fit.identifier, fit.place, fit.shape) == ("cogging", "sun", order)
    (size,) = found.fitted_sizes
    assert size.value == pytest.approx(0.03, abs=4.0 * size.error)
    assert f"{order} periods a turn" in size.sentence
    assert found.size_errors[0][-1] == 0.0, "an order is one of whole numbers"


@pytest.mark.parametrize(("frequency", "passes"), [(3.0, 1.0), (18.0, 1.0), (60.0, 0.0)])
def test_a_wave_is_in_the_band_of_the_rows_or_is_taken_out(frequency: float, passes: float) -> None:
    run = smooth(_run(1, Manoeuvre.DITHER, _dither(60.0), np.random.default_rng(1)))
    wave = np.sin(2.0 * np.pi * frequency * run.time)
    inner = slice(100, -100)
    assert np.abs(run.in_band(wave) - passes * wave)[inner].max() < 0.01
    assert len(run.in_band(wave)) == len(wave)


@pytest.mark.parametrize("law", [lagging, stopping])
def test_the_noise_of_counts_does_not_soften_a_hysteresis(law: Callable[[np.ndarray, float], np.ndarray]) -> None:
    """A swing of 50 mrad, counts that let it tremble by 2 mrad, bristles that give way at 4 mrad."""
    run = smooth(_run(1, Manoeuvre.DITHER, _dither(60.0), np.random.default_rng(1)))
    angle = 0.05 * np.sin(2.0 * np.pi * 3.0 * run.time)
    noisy = angle + 2e-3 * np.random.default_rng(2).standard_normal(len(angle))
    true, as_it_is, in_band = (run.rows(law(each, 4e-3)) for each in (angle, noisy, run.in_band(noisy)))

    def size(found: np.ndarray) -> float:
        return float(found @ true) / float(true @ true)

    assert abs(size(in_band) - 1.0) < 0.5 * abs(size(as_it_is) - 1.0)
    assert np.std(in_band - true) < 0.6 * np.std(as_it_is - true)
