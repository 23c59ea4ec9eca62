"""A torque that is shown late: delays and lags of several orders, and what the filters of the rows make of them."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import odeint
from scipy.linalg import cholesky_banded
from scipy.signal import butter, lfilter, sosfilt
from tests.diagnosis.test_motion import RATE, _campaign, _dither, _run, _with_torque
from tests.slow import slow

from pmg.pipeline.diagnosis.balance.catalogue import TermNaming, TermSet
from pmg.pipeline.diagnosis.balance.fitting import Tabled, TermFit, TermProblem, fit_term
from pmg.pipeline.diagnosis.balance.library.term import Term
from pmg.pipeline.diagnosis.engine.adequacy import Remainder
from pmg.pipeline.diagnosis.engine.problem import bounded_sizes
from pmg.pipeline.diagnosis.motion import naming
from pmg.pipeline.diagnosis.motion.candidates.late_terms import HELD, _lagging
from pmg.pipeline.diagnosis.motion.candidates.library import library
from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm
from pmg.pipeline.diagnosis.motion.catalogue import (
    MotionCatalogue,
    other_lateness,
    with_late_look_alikes,
    without_opposed,
)
from pmg.pipeline.diagnosis.motion.constants import SKEW, sheet_of
from pmg.pipeline.diagnosis.motion.decide import MotionDiagnosis, diagnose_motion
from pmg.pipeline.diagnosis.motion.document import motion_document
from pmg.pipeline.diagnosis.motion.evidence import MotionEvidence
from pmg.pipeline.diagnosis.motion.fitted import fit_beside, fit_constants, noise_beside
from pmg.pipeline.diagnosis.motion.fitted_size import fitted_size
from pmg.pipeline.diagnosis.motion.naming import _beside_whole, _elsewhere
from pmg.pipeline.diagnosis.motion.noise.row_noise import RowNoise, SlowNoise
from pmg.pipeline.diagnosis.motion.traces import effects_of, traces_of
from pmg.pipeline.diagnosis.motion.view import RotorView
from pmg.pipeline.files.progress import Steps
from pmg.pipeline.motion.banded import BandedFactor
from pmg.pipeline.motion.lag import BUTTERWORTH, EQUAL_LAGS, FIRST_ORDER, Lag
from pmg.pipeline.motion.run import MovingRun
from pmg.pipeline.motion.smooth import FINE_RATE, smooth
from pmg.pipeline.recording.run_records import Manoeuvre
from pmg.pipeline.trials.motion.nature import measure_motion_case
from pmg.pipeline.trials.score.case_list import draw_motion_lots
from pmg.sim.bench import load_bench
from pmg.sim.shafts import PerShaft
from pmg.sim.signals import Array

TERMS = {term.key: term for term in library()}
NOISE = 0.012


def _shown(late: str, time: float) -> MotionDiagnosis:
    """The diagnosis of a campaign whose sun torque is shown late by a time [s]."""
    rng = np.random.default_rng(5)

    def shown(torque: Array) -> Array:
        if late == "delay":
            k = round(time * RATE)
            return np.concatenate([np.full(k, torque[0]), torque[:-k]])
        order = {"first": 1, "second": 2}[late]
        kept = math.exp(-order / RATE / time)
        for _ in range(order):
            torque = lfilter([1.0 - kept], [1.0, -kept], torque)
        return np.asarray(torque + NOISE * rng.standard_normal(len(torque)))

    runs = tuple(_with_torque(run, shown(run.torque.sun) - run.torque.sun) for run in _campaign(31))
    return diagnose_motion(late, runs, load_bench(), np.random.default_rng(0))


def test_a_set_holds_one_that_makes_a_torque_late() -> None:
    rows = np.eye(6)
    late, delay = TERMS["transducer_bandwidth/sun/first order"], TERMS["channel_delay/ring/"]
    tables = {
        t.key: Tabled(t, np.array([0.01]), rows[:, k, None, None])
        for k, t in enumerate((late, delay, TERMS["torque_gain_error/sun/"]))
    }
    problem = TermProblem(np.zeros((6, 0)), rows[0], lambda t, _: tables[t.key].columns[:, 0], tables)
    ids = [{fit.identifier for fit in MotionCatalogue().rank(problem, taken)} for taken in ((), ("channel_delay",))]
    assert ids == [{"transducer_bandwidth", "channel_delay", "torque_gain_error"}, {"torque_gain_error"}]


def test_what_both_transducers_do_alike_leads_a_set_or_is_none_of_it() -> None:
    rows = np.eye(6)
    keys = "torque_gain_error/sun/", "channel_delay/both/angles late", "channel_delay/sun/"
    tables = {key: Tabled(TERMS[key], np.array([0.01]), rows[:, place, None, None]) for place, key in enumerate(keys)}
    problem = TermProblem(np.zeros((6, 0)), rows[:3].sum(axis=0), lambda t, _: tables[t.key].columns[:, 0], tables)
    alone, beside = (
        {fit.candidate.key for fit in MotionCatalogue().rank(problem, taken)} for taken in ((), ("torque_gain_error",))
    )
    assert alone == set(keys)
    assert beside == {"channel_delay/sun/"}


@pytest.mark.parametrize("order", ["first order", "second order"])
@pytest.mark.parametrize(("form", "plain", "alike"), [("", 0.4, False), ("", 0.15, True), (HELD, 0.4, True)])
def test_a_short_lag_is_a_rival_of_a_delay_where_a_plain_lag_is_one_and_of_one_that_is_held(
    order: str, form: str, plain: float, alike: bool
) -> None:
    """The laws stand in one plane, the short lag at 0.1 rad from the delay that made the rows, the plain one beyond."""
    angles = {f"channel_delay/sun/{form}": 0.0, "transducer_bandwidth/sun/second order, short": 0.1}
    angles[f"transducer_bandwidth/sun/{order}"] = plain
    problem = _in_a_plane(angles)
    best, short = (TermSet((fit := fit_term(problem, TERMS[key]),), problem.take_out(fit)) for key in list(angles)[:2])
    nothing_left = Remainder(1.0, 0.0, 0.0)
    found = TermNaming(best, (short,), {"channel_delay": "sun"}, nothing_left, True, True, (), ())
    rivals = with_late_look_alikes(found, problem).rivals
    assert [rival.ids for rival in rivals] == [{"transducer_bandwidth"}] * alike


@pytest.mark.parametrize(
    ("explained", "apart", "alike"), [(True, 0.6, False), (False, 0.6, True), (False, 0.75, False)]
)
def test_a_lag_that_leaves_more_than_noise_is_told_from_no_delay_near_it(
    apart: float, *, explained: bool, alike: bool
) -> None:
    """The delay explains the squared cosine of that angle [rad] of what the lag does."""
    keys = "transducer_bandwidth/sun/second order", "channel_delay/sun/held"
    problem = _in_a_plane(dict(zip(keys, (0.0, apart), strict=True)))
    best = TermSet((fit := fit_term(problem, TERMS[keys[0]]),), problem.take_out(fit))
    left = Remainder(1.0, 0.0, 0.0)
    found = TermNaming(best, (), {"transducer_bandwidth": "sun"}, left, explained, True, (), ())
    assert [rival.ids for rival in with_late_look_alikes(found, problem).rivals] == [{"channel_delay"}] * alike


def _in_a_plane(angles: dict[str, float]) -> TermProblem:
    """Rows along a first axis, and laws at angles [rad] to it."""
    tables = {
        key: Tabled(
            TERMS[key], np.array([0.005]), (12.0 * np.array([math.cos(a), math.sin(a), 0, 0, 0, 0]))[:, None, None]
        )
        for key, a in angles.items()
    }
    rows = 12.0 * np.eye(6)[0]
    return TermProblem(np.zeros((6, 0)), rows, lambda t, _: tables[t.key].columns[:, 0], tables)


@pytest.mark.parametrize(
    ("first", "second", "nearest"), [(0.4, 0.5, "first order"), (0.4, 0.3, "second order"), (1.0, 1.2, "")]
)
def test_a_lag_that_explains_most_of_what_a_delay_does_is_tried_in_its_place(
    first: float, second: float, nearest: str
) -> None:
    delay, lag = "channel_delay/sun/", "transducer_bandwidth/sun/"
    lags = {f"{lag}first order": first, f"{lag}second order": second, f"{lag}second order, short": 0.0}
    problem = _in_a_plane({delay: 0.0, "channel_delay/sun/held": 0.1, **lags})
    about = _about(problem, skew=0.0)
    found = other_lateness(TermSet((fit_term(about.problem, TERMS[delay]),), about.problem), about)
    assert [fit.candidate.key for fits in found for fit in fits] == [f"{lag}{nearest}"] * bool(nearest)


def _about(problem: TermProblem, skew: float, beside: float = 0.0) -> MotionEvidence:
    """Evidence about a skew of the sun's torque that is so many standard uncertainties off, `beside` it as fitted."""
    sheet = sheet_of(load_bench(), 1, ())
    values = sheet.expected.copy()
    values[sheet.at("skew_sun")] += skew * SKEW
    rows = len(sheet.known)
    tables = {
        key: replace(each, columns=np.pad(each.columns, ((0, rows), (0, 0), (0, 0))))
        for key, each in problem.tables.items()
    }
    left = np.pad(problem.left, (0, rows))
    left[6 + list(sheet.known).index(sheet.at("skew_sun"))] = beside
    longer = TermProblem(np.zeros((6 + rows, 0)), left, lambda t, _: tables[t.key].columns[:, 0], tables)
    of_sheet = np.arange(6 + rows) >= 6
    found = SimpleNamespace(problem=longer, baseline=SimpleNamespace(sheet=sheet, values=values), of_sheet=of_sheet)
    return cast("MotionEvidence", found)


@pytest.mark.parametrize(
    ("skew", "beside", "tried"),
    [(0.0, 0.0, False), (-2.5, 2.5, False), (-14.0, 0.0, True), (14.0, 0.0, True), (0.0, 4.0, True), (0.0, -4.0, True)],
)
def test_a_lag_that_a_skew_holds_up_is_held_against_one_of_another_order(
    skew: float, beside: float, tried: bool
) -> None:
    """The rows are about that skew, or such a one is beside the lag as it is fitted."""
    first, second = (f"transducer_bandwidth/sun/{order} order" for order in ("first", "second"))
    problem = _in_a_plane({second: 0.0, first: 0.3, "channel_delay/sun/": 1.2, "channel_delay/sun/held": 1.2})
    about = _about(problem, skew, beside)
    found = other_lateness(TermSet((fit_term(about.problem, TERMS[second]),), about.problem), about)
    assert [fit.candidate.key for fits in found for fit in fits] == [first] * tried


@pytest.mark.parametrize(
    ("left", "leads", "rival", "explained", "told", "open_"),
    [
        (80.0, "lag", "", True, "lag", False),
        (95.0, "lag", "", True, "delay", True),  # by less than what tells two causes apart
        (105.0, "lag", "", True, "delay", True),
        (115.0, "lag", "", True, "delay", False),
        (80.0, "delay", "", True, "delay", False),  # on its own rows something else leads
        (80.0, "delay", "lag", True, "delay", True),  # it does, and by as little
        (80.0, "lag", "", False, "delay", False),
    ],
)
def test_a_delay_is_held_against_a_lag_on_rows_of_its_own(
    left: float, leads: str, rival: str, explained: bool, told: str, *, open_: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    keys = {"delay": "channel_delay/sun/", "lag": "transducer_bandwidth/sun/first order"}
    fits = {name: (TermFit(TERMS[key], 1.0, 1.0, np.zeros(1), (), np.ones(1), 0.01),) for name, key in keys.items()}

    def explanation(name: str) -> SimpleNamespace:
        ids = frozenset(fit.identifier for fit in fits[name])
        return SimpleNamespace(fits=fits[name], ids=ids, score={"delay": 300.0, "lag": 260.0}[name])

    def search(name: str, rival: str) -> SimpleNamespace:
        best, rivals = explanation(name), (explanation(rival),) if rival else ()
        explains = explained or name != leads
        return SimpleNamespace(best=best, rivals=rivals, explained=explains, evidence_scale=1.0, name=name)

    rows = SimpleNamespace(baseline=SimpleNamespace(values=np.zeros(1)), problem=None)
    first, other = (SimpleNamespace(**vars(rows), left=size) for size in (100.0, left))
    monkeypatch.setattr(naming, "other_lateness", lambda *_: iter([fits["lag"]]))
    monkeypatch.setattr(naming, "replace", lambda one, **changed: SimpleNamespace(**(vars(one) | changed)))
    monkeypatch.setattr(naming, "explain_with", lambda *_: explanation("lag"))
    monkeypatch.setattr(naming, "_beside_whole", lambda *_: rows)
    monkeypatch.setattr(naming, "noise_beside", lambda _, noise: noise)
    monkeypatch.setattr(naming, "motion_evidence", lambda *_: other)
    monkeypatch.setattr(naming, "without_opposed", lambda found: found)
    monkeypatch.setattr(naming, "_searched", lambda *_: search(leads, rival))
    monkeypatch.setattr(naming, "_left_by", lambda _, about: about.left)
    led = cast("Any", (first, first, search("delay", "")))
    *_, found = naming._against_other_lateness(led, cast("Any", rows), [], np.random.default_rng(0))
    assert cast("Any", found).name == told
    assert [each.ids for each in found.rivals] == [{"transducer_bandwidth"}] * open_
    assert found.evidence_scale == (10.0 / 40.0 if open_ else 1.0)  # it falls short on rows about the delay alone


@pytest.mark.parametrize(
    ("before", "after", "moved"),
    [
        (("channel_delay/sun/", 0.010), ("channel_delay/sun/", 0.0115), False),
        (("channel_delay/sun/", 0.010), ("channel_delay/sun/", 0.0125), True),
        (("channel_delay/sun/", 0.010), ("channel_delay/ring/", 0.010), True),
        (("channel_delay/sun/", 0.010), ("transducer_bandwidth/sun/first order", 0.010), True),
        (("torque_gain_error/sun/", math.nan), ("torque_gain_error/sun/curved", math.nan), False),
        (("transducer_bandwidth/sun/", math.nan), ("transducer_bandwidth/sun/second order", 0.02), True),
        (("transducer_bandwidth/sun/second order", 0.02), ("transducer_bandwidth/sun/", math.nan), False),
        (("transducer_bandwidth/sun/second order, short", 8e-3), ("transducer_bandwidth/sun/second order", 8e-3), True),
        (("channel_delay/sun/", 0.02), ("channel_delay/sun/held", 5e-3), True),
    ],
)
def test_rows_are_made_straight_again_where_another_cause_or_another_time_leads(
    before: tuple[str, float], after: tuple[str, float], moved: bool
) -> None:
    def fits(key: str, shape: float) -> tuple[TermFit, ...]:
        return (TermFit(TERMS[key], 1.0, 1.0, np.zeros(1), (), np.ones(1), shape),)

    assert _elsewhere(fits(*before), fits(*after)) is moved


@pytest.mark.parametrize(
    ("led", "left", "told"),
    [
        ("aa", (9,), "a1"),
        ("abb", (9, 5), "b2"),
        ("abA", (9, 5), "b1"),  # given up with the second turn, as what leads then explains less
        ("abab", (9, 5, 8), "b1"),
        ("ABaB", (9, 5, 8), "a2"),
        ("ABAb", (9, 5, 8), "b3"),
        ("aBCA", (9, 5, 8), "a0"),
        ("abca", (3, 5, 8), "a0"),
        ("adad", (9, 5, 8), "a2"),  # the pair leaves less, and one explains it as well
        ("Adbd", (9, 5, 8), "b2"),
        ("Adad", (9, 5, 8), "a2"),
    ],
)
def test_leaders_that_do_not_settle_are_held_against_each_other(
    led: str, left: tuple[float, ...], told: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Letters are mechanisms that lead one search after the other, capital ones without explaining the difference."""
    delay, gain, other = "channel_delay/sun/", "torque_gain_error/sun/", "torque_gain_error/ring/"
    keys = {"a": (delay,), "b": (gain,), "c": (other,), "d": (delay, gain)}
    searches = iter(
        SimpleNamespace(
            best=SimpleNamespace(
                fits=tuple(
                    TermFit(TERMS[key], 1.0, 1.0, np.zeros(1), (), np.ones(1), 0.01) for key in keys[each.lower()]
                )
            ),
            explained=each.islower(),
            name=f"{each}{turn}",
        )
        for turn, each in enumerate(led)
    )
    sums = iter(left)
    about = SimpleNamespace(values=np.zeros(1), problem=None, evidence=None)
    monkeypatch.setattr(naming, "STRAIGHTENED", len(left))
    monkeypatch.setattr(naming, "replace", lambda before, **_: before)
    monkeypatch.setattr(naming, "adequacy_test", lambda _: None)
    monkeypatch.setattr(naming, "_beside_whole", lambda *_: about)
    monkeypatch.setattr(naming, "noise_beside", lambda _, noise: noise)
    monkeypatch.setattr(naming, "motion_evidence", lambda *_: about)
    monkeypatch.setattr(naming, "without_opposed", lambda found: found)
    monkeypatch.setattr(naming, "_searched", lambda *_: next(searches))
    monkeypatch.setattr(naming, "_left_by", lambda *_: next(sums))
    monkeypatch.setattr(naming, "on_spring", lambda found, _: found)
    monkeypatch.setattr(naming, "_against_other_lateness", lambda search, *_: search)
    for name in (
        "with_free_laws",
        "with_look_alikes",
        "with_late_look_alikes",
        "without_held",
        "with_small_rest",
        "unless_like_filter",
    ):
        monkeypatch.setattr(naming, name, lambda found, *_: found)
    steps, rng = Steps(None, *naming.SEARCH_STEPS), np.random.default_rng(0)
    *_, found = naming.name_causes(cast("Any", about), cast("Any", about), [], rng, steps)
    assert cast("Any", found).name == told


@given(st.floats(2.0, 20.0), st.floats(2e-3, 8e-3))
def test_the_short_lag_is_undone_by_its_own_law(frequency: float, lag: float) -> None:
    """Of a wave through two lags of half the time each, the law gives what it was, with the opposite sign missing."""
    rate = 2j * math.pi * frequency
    shown = 1.0 / (1.0 + 0.5 * lag * rate) ** 2
    time = np.arange(0.0, 1.0, 1e-3)
    torque, slope, curvature = ((shown * rate**k * np.exp(rate * time)).imag for k in range(3))
    term = TERMS["transducer_bandwidth/sun/second order, short"]

    def beyond(skew: float) -> Array:
        view = SimpleNamespace(
            skew=skew, shaft=SimpleNamespace(torque=torque, torque_rate=slope, torque_curvature=curvature)
        )
        return np.asarray(term.columns(cast("RotorView", view), lag)[:, 0])

    np.testing.assert_allclose(torque - beyond(0.0), np.exp(rate * time).imag, atol=1e-9)
    at_once = (rate * 1e-4 * -lag * rate * shown * np.exp(rate * time)).imag
    np.testing.assert_allclose(beyond(1e-4) - beyond(0.0), at_once, atol=1e-9)
    assert term.hears is not None
    own, other = term.hears(np.array([rate]), lag)
    assert np.allclose(own, 1.0 - 1.0 / shown)
    assert other == 0.0


@dataclass(frozen=True)
class _Evidence:
    """As much of it as the constants of its data sheet need: one row of noise, then the data sheet's."""

    problem: TermProblem
    baseline: Any
    of_sheet: npt.NDArray[np.bool_]


@pytest.mark.parametrize(
    ("key", "ahead", "kept"),
    [
        ("transducer_bandwidth/sun/first order", 4.0, False),
        ("transducer_bandwidth/sun/first order", 2.0, True),
        ("transducer_bandwidth/sun/first order", -9.0, True),
        ("transducer_bandwidth/both/Butterworth", 4.0, False),
        ("channel_delay/both/angles late", -4.0, False),
        ("channel_delay/both/angles late", 9.0, True),
    ],
)
def test_what_is_late_beside_a_skew_that_leads_as_far_is_not_tried(key: str, ahead: float, kept: bool) -> None:
    """The skew of the sun's reading leads by so many standard uncertainties beside it; nothing else has one."""
    sheet = sheet_of(load_bench(), 1, ())
    at = 1 + int(np.flatnonzero(sheet.known == sheet.at("skew_sun"))[0])
    column = np.zeros(1 + len(sheet.known))
    column[[0, at]] = 1.0, -ahead
    late, gain = TERMS[key], TERMS["torque_gain_error/sun/"]
    tables = {t.key: Tabled(t, np.array([0.01]), column[:, None, None]) for t in (late, gain)}
    problem = TermProblem(np.zeros((len(column), 0)), np.zeros(len(column)), lambda *_: column[:, None], tables)
    found = _Evidence(problem, SimpleNamespace(sheet=sheet), np.arange(len(column)) > 0)
    left = without_opposed(cast("MotionEvidence", found)).problem.tables
    assert set(left) == ({late.key, gain.key} if kept else {gain.key})


@pytest.mark.parametrize("time", [0.005, pytest.param(0.012, marks=slow)])
def test_a_delay_is_named_whole_with_its_time(time: float) -> None:
    """Its one number is the time, with an error; that all of the torque is late is no finding."""
    found = _shown("delay", time)
    assert found.naming is not None
    (fit,) = found.naming.best.fits
    assert fit.identifier == "channel_delay"
    (size,) = found.fitted_sizes
    assert (size.name, size.unit) == ("delay", "s")
    assert size.value == pytest.approx(time + 0.5 / RATE, abs=1e-4)  # angles of these runs are ahead by half a sample
    # What the data sheet leaves open between the channels is as good a delay; a torque that is held may stay possible.
    assert SKEW < size.error < 0.25 * time
    (mechanism, *_) = motion_document(found)["mechanisms"]
    assert [each["name"] for each in mechanism["parameters"]] == ["delay"]


@slow
def test_a_lag_of_second_order_is_not_taken_for_a_delay_alone() -> None:
    found = _shown("second", 0.010)
    assert found.verdict.names
    assert found.naming is not None
    sets = (found.naming.best, *found.naming.rivals)
    assert "transducer_bandwidth" in {fit.identifier for each in sets for fit in each.fits}


@pytest.mark.parametrize("order", [pytest.param("first", marks=slow), "second"])
def test_a_lag_that_is_long_in_the_band_is_told_with_its_time(order: str) -> None:
    found = _shown(order, 0.030)
    assert found.naming is not None
    (fit,) = found.naming.best.fits
    assert (fit.identifier, fit.place) == ("transducer_bandwidth", "sun")
    (size,) = found.fitted_sizes
    assert (size.name, size.unit) == ("lag", "s")
    assert size.value == pytest.approx(0.030, rel=0.01)
    (told,) = motion_document(found)["mechanisms"][0]["parameters"]
    assert (told["name"], told["standard_error"]) == ("lag", pytest.approx(size.error, rel=1e-4))
    assert found.size_errors[0][1] < 0.5 * SKEW, "a lag that is long in the band is told from a skew"


def lagged_runs(lag: float, seed: int = 100) -> tuple[MovingRun, ...]:
    """Runs whose sun torque goes through a lag of the first order, exact for straight lines between its samples.

    Their torque comes half a sample after their angles: a rotor's angle is the sum of its speeds so far.
    """
    kept, time = math.exp(-1.0 / RATE / lag), lag * RATE
    later = (1.0 - kept) * time
    shown = [lfilter([1.0 - later, later - kept], [1.0, -kept], run.torque.sun) for run in _campaign(seed)]
    noise = np.random.default_rng(seed)
    return tuple(
        _with_torque(run, each - run.torque.sun + NOISE * noise.standard_normal(len(each)))
        for run, each in zip(_campaign(seed), shown, strict=True)
    )


HALF_A_SAMPLE, TOLD_APART = 0.5 / RATE, 0.015


@pytest.mark.parametrize("lag", [0.022, *(pytest.param(time, marks=slow) for time in (0.004, 0.012, 0.02, 0.04, 0.06))])
def test_a_lag_of_any_size_is_named_beside_a_skew(lag: float) -> None:
    """Between tabled times its hill is narrow, and another one is of what compliance, skew and inertia take up."""
    found = diagnose_motion("lagged", lagged_runs(lag), load_bench(), np.random.default_rng(0))
    assert found.verdict.names
    assert found.naming is not None
    assert found.naming.best.ids == {"transducer_bandwidth"}
    (size,) = found.fitted_sizes
    noise = found.size_errors[0][-1]
    assert abs(size.value - lag) < 3.0 * noise + 0.003 * lag
    assert noise < (0.8 if lag > TOLD_APART else 1.01) * SKEW
    for name, true in (("inertia_sun", 0.00166), ("compliance_sun", 1.0 / 4000.0), ("skew_sun", HALF_A_SAMPLE)):
        at = found.before.sheet.at(name)
        if lag > TOLD_APART:
            assert abs(found.constants[at] - true) < 3.0 * found.errors[at] + 0.003 * true, name


def test_a_lag_and_a_skew_are_told_from_each_other() -> None:
    """The slope of a torque as shown holds that of its noise: a skew made of it would undo a longer lag."""
    before, _, noise = fit_constants(lagged_runs(0.02), load_bench())
    term = TERMS["transducer_bandwidth/sun/first order"]
    for start in (0.0195, 0.0205):
        fit = TermFit(term, 0.0, 0.0, np.zeros(0), (), np.ones(1), start)
        found, _ = fit_beside(before, noise, (fit,))
        assert float(found.amounts[0]) * start == pytest.approx(0.02, abs=1.5e-4)
        skew = found.sheet.at("skew_sun")
        assert found.values[skew] == pytest.approx(HALF_A_SAMPLE, abs=1.2e-4)
        twice = replace(found, values=np.where(np.arange(len(found.values)) == skew, 2.0, 1.0) * found.values)
        once, more = (
            np.mean(
                np.concatenate([n.white(each.left(k)[:, None]) for k, n in enumerate(noise_beside(found, noise))]) ** 2
            )
            for each in (found, twice)
        )
        assert once < 1.1 < 1.3 < more, "what is left is noise, the skew counted once"


def test_a_lag_comes_back_from_four_times_its_time() -> None:
    """Its time moves by a factor of two at most at a step; a time below nothing stays inside its bounds."""
    before, _, noise = fit_constants(lagged_runs(0.02), load_bench())
    fit = TermFit(TERMS["transducer_bandwidth/sun/first order"], 0.0, 0.0, np.zeros(0), (), np.ones(1), 0.08)
    (lag,) = _beside_whole(before, noise, (fit,)).lags
    assert lag.time == pytest.approx(0.02, rel=0.1)


POLES: dict[float, list[complex]] = {
    FIRST_ORDER: [-1.0],
    EQUAL_LAGS: [-2.0, -2.0],
    BUTTERWORTH: [-1.0 + 1.0j, -1.0 - 1.0j],
}
"""Of each form of lag, in units of one over its time."""


@given(st.floats(1e-3, 0.1), st.sampled_from(sorted(POLES)), st.floats(0.5, 25.0))
def test_a_lag_shifts_and_weakens_a_wave_as_its_response_says(lag: float, sharpness: float, frequency: float) -> None:
    time, rate = np.arange(5000) / FINE_RATE, 2.0 * np.pi * frequency
    run = SimpleNamespace(fine_rate=FINE_RATE)
    state = SimpleNamespace(coupling_torque=0.5 + np.sin(rate * time), stretch=SimpleNamespace(run=run))
    view = SimpleNamespace(state=state, side="sun")
    shown = 0.5 + np.sin(rate * time) + _lagging(cast("RotorView", view), lag, sharpness)[:, 0]
    response = complex(Lag("sun", lag, sharpness).response(np.array([1j * rate]))[0])
    assert response == pytest.approx(complex(np.prod([1.0 / (1.0 - 1j * rate * lag / p) for p in POLES[sharpness]])))
    expected = 0.5 + np.abs(response) * np.sin(rate * time + np.angle(response))
    inside = (time > 20.0 * lag + 0.5) & (time < time[-1] - 0.5)  # the filters of the rows take 0.3 s at either end
    assert np.abs(shown - expected)[inside].max() < 2e-3


def test_a_lag_shows_a_ramp_late_and_keeps_no_memory_of_another_column() -> None:
    ramp, still = np.arange(200) / FINE_RATE, np.full(200, 3.0)
    shown = Lag("ring", 0.02, BUTTERWORTH).of(np.stack([ramp, still], 1), FINE_RATE)
    assert shown[60:-20] == pytest.approx(np.stack([ramp - 0.02, still], 1)[60:-20], abs=2e-5)
    assert shown[:, 1] == pytest.approx(still, abs=1e-9)


def test_a_step_after_a_steady_start_is_shown_late_from_its_first_instant_on() -> None:
    time = np.arange(500) / FINE_RATE
    step = 0.5 + 0.5 * np.tanh((time - 0.15) / 0.01)
    shown = Lag("sun", 0.1, FIRST_ORDER).of(step[:, None], FINE_RATE)[:, 0]
    expected = odeint(lambda y, t: (0.5 + 0.5 * np.tanh((t - 0.15) / 0.01) - y) / 0.1, 0.0, time)[:, 0]
    assert np.abs(shown - expected).max() < 2e-3


def test_the_size_of_what_is_late_as_a_whole_is_its_time() -> None:
    law = TERMS["channel_delay/sun/"]
    fit = TermFit(law, 1.0, 1.0, np.zeros(4), (), np.ones(1), 0.007)
    size = fitted_size(fit, np.array([1.0, 0.0071]), np.diag([0.0, 4e-8]), PerShaft(3, 10), of_law=1.5e-4)
    assert (size.name, size.value, size.unit) == ("delay", 0.0071, "s")
    assert size.error == pytest.approx(2.5e-4)


@pytest.mark.parametrize("variant", ["", "first order", "second order, short", "second order"])
def test_the_size_of_a_low_pass_tells_its_corner(variant: str) -> None:
    """By the filter that the law has: at its corner it shows the half of the power."""
    law, time = TERMS[f"transducer_bandwidth/sun/{variant}"], 0.0071
    fit = TermFit(law, 1.0, 1.0, np.zeros(4), (), np.ones(1), time)
    values, errors = (np.array([time]), np.eye(1)) if not law.whole else (np.array([1.0, time]), np.diag([0.0, 1.0]))
    told = fitted_size(fit, values, (2e-5) ** 2 * errors, PerShaft(3, 10)).sentence
    (corner,) = re.findall(r"corner at ([\d.]+) ± [\d.]+ Hz", told)
    wave = 2j * np.pi * float(corner)
    shown = 1.0 / (1.0 + wave * time) if variant in {"", "first order"} else 1.0 / (1.0 + 0.5 * wave * time) ** 2
    assert abs(shown) ** 2 == pytest.approx(0.5, abs=0.01)


def test_a_low_pass_of_butterworth_has_the_corner_of_its_design() -> None:
    b, a = butter(2, 2.0 * np.pi * 14.0, analog=True)
    assert Lag("sun", float(a[1] / a[2]), BUTTERWORTH).corner == pytest.approx(14.0)
    assert b[-1] / a[2] == pytest.approx(1.0)


def test_a_law_whose_amplitude_is_known_costs_its_time_alone() -> None:
    rows, size = np.linspace(0.0, 1.0, 50), 1000.0  # of the wave, in units of the noise
    law = replace(TERMS["channel_delay/sun/"], columns=lambda _, d: size * np.sin(20.0 * (rows + d))[:, None])

    def columns_of(term: Term[Any], shape: float) -> Array:
        return np.asarray(term.columns(None, shape))

    shapes = np.geomspace(1e-3, 0.05, 20)
    tables = {law.key: Tabled(law, shapes, np.stack([columns_of(law, d) for d in shapes], axis=1))}
    problem = TermProblem(np.zeros((50, 0)), columns_of(law, 0.0071)[:, 0], columns_of, tables)
    fit = fit_term(problem, law)
    assert fit.shape == pytest.approx(0.0071, rel=1e-3)
    assert (fit.cost, list(fit.amplitudes), fit.on_bound) == (1.0, [1.0], ())


@given(st.integers(1, 4), st.integers(0, 15), st.integers(0, 99))
def test_sizes_that_are_known_are_kept_and_the_others_fit_the_rest(count: int, which: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    columns, rows = rng.standard_normal((12, count)), rng.standard_normal(12)
    known = np.array([bool(which >> k & 1) for k in range(count)])
    value = rng.standard_normal(count)
    rest, sizes = bounded_sizes(columns, rows, np.where(known, value, np.array([[-1e3], [1e3]])))
    free = np.linalg.lstsq(columns[:, ~known], rows - columns[:, known] @ value[known], rcond=None)[0]
    np.testing.assert_allclose(sizes[known], value[known])
    np.testing.assert_allclose(sizes[~known], free, atol=1e-8)
    assert rest == pytest.approx(float(np.sum((rows - columns @ sizes) ** 2)))


@given(st.integers(1, 150), st.integers(1, 90), st.integers(1, 3), st.integers(0, 99))
def test_a_banded_matrix_is_solved_as_a_full_one(n: int, band: int, count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    diagonals = 0.5 * rng.uniform(-1.0, 1.0, (min(band, n), n)) / band
    diagonals[0] = 1.0
    factor = cholesky_banded(diagonals, lower=True)
    whole = np.zeros((n, n))
    for k, row in enumerate(factor):
        whole += np.diag(row[: n - k], -k)
    columns = rng.standard_normal((n, count))
    np.testing.assert_allclose(whole @ BandedFactor.of(factor).solved(columns), columns, atol=1e-9)
    np.testing.assert_allclose(whole.T @ BandedFactor.of(factor).adjoint(columns), columns, atol=1e-9)


@given(st.integers(1, 150), st.integers(1, 3), st.integers(0, 99))
def test_rows_weighted_before_they_are_whitened_give_the_same_products(n: int, count: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    wander = np.linalg.qr(rng.standard_normal((n, min(n, 4))))[0]
    band = np.stack([np.full(n, 1.5), np.full(n, 0.6)])
    shrunk = np.asarray(rng.uniform(0.0, 1.0, wander.shape[1]))
    noise = RowNoise(
        BandedFactor.of(cholesky_banded(band, lower=True)),
        wander,
        shrunk,
        0.0,
        "sun",
        SlowNoise(),
        wander[:, :0],
        np.zeros(0),
        wander[:, :0],
        np.zeros((1, n)),
    )
    one, other = rng.standard_normal((2, n, count))
    np.testing.assert_allclose(noise.adjoint(one).T @ other, one.T @ noise.white(other), atol=1e-9)


@given(st.floats(0.002, 0.028), st.floats(1.0, 60.0))
def test_a_shape_between_those_tabled_is_found_to_less_than_the_noise(delay: float, rate: float) -> None:
    rows, size = np.linspace(0.0, 1.0, 50), 30.0  # of the wave, in units of the noise
    law = replace(TERMS["channel_delay/sun/"], columns=lambda _, d: size * np.sin(rate * (rows + d))[:, None])

    def columns_of(term: Term[Any], shape: float) -> Array:
        return np.asarray(term.columns(None, shape))

    shapes = np.geomspace(1e-3, 0.05, 8)
    tables = {law.key: Tabled(law, shapes, np.stack([columns_of(law, d) for d in shapes], axis=1))}
    problem = TermProblem(np.zeros((50, 0)), columns_of(law, delay)[:, 0], columns_of, tables)
    assert fit_term(problem, law).gain > problem.left @ problem.left - 2.0


@pytest.mark.parametrize("length", [60, 61, 62, 700, 701, 702, 815])
def test_rows_are_the_weighted_samples_about_each_of_them(length: int) -> None:
    run = smooth(_run(1, Manoeuvre.DITHER, _dither(60.0), np.random.default_rng(1)))
    fine = np.random.default_rng(2).standard_normal((length, 2, 3))
    weights = run.weights
    starts = range(0, length - len(weights) + 1, 3)
    expected = [np.tensordot(weights, fine[k : k + len(weights)], (0, 0)) for k in starts] or np.zeros((0, 2, 3))
    np.testing.assert_allclose(replace(run, time=np.arange(length) / run.fine_rate).rows(fine), expected, atol=1e-12)


MILLISECONDS = 1000.0
"""Rate of the runs of the trial [1/s]."""


def _clean(seed: int) -> tuple[MovingRun, ...]:
    """A campaign of the trial without a cause."""
    (lot,) = draw_motion_lots(1, seed, ("clean",))
    runs = tuple(measure_motion_case(lot.draw(), lot.rng("measure")))
    assert {run.rate for run in runs} == {MILLISECONDS}
    return runs


@slow
def test_a_torque_that_is_renewed_late_is_in_the_set() -> None:
    """On rows that hold noise of their own a lag leads here, the skew beside it seven standard uncertainties off."""
    lot = draw_motion_lots(140, 20261130620)[76]
    case = lot.draw()
    assert [effect["id"] for effect in case.truth["effects"]] == ["channel_delay"]
    runs = tuple(measure_motion_case(case, lot.rng("measure")))
    found = diagnose_motion(case.campaign, runs, load_bench(), np.random.default_rng(0)).naming
    assert found is not None
    assert any("channel_delay" in each.ids for each in (found.best, *found.rivals))


@slow
@pytest.mark.parametrize("late", ["torque", "angle"])
def test_what_is_late_on_both_shafts_alike_is_told_as_one_delay(late: str) -> None:
    def later(signal: Array) -> Array:
        return np.concatenate([np.full(8, signal[0]), signal[:-8]])

    runs = tuple(replace(run, **{late: getattr(run, late).map(later)}) for run in _clean(20261130482))
    found = diagnose_motion(late, runs, load_bench(), np.random.default_rng(0))
    assert found.verdict.names
    assert found.naming is not None
    (fit,) = found.naming.best.fits
    variant = {"torque": "", "angle": "angles late"}[late]
    assert cast("MotionTerm", fit.candidate).key == f"channel_delay/both/{variant}"
    (size,) = found.fitted_sizes
    assert size.value == pytest.approx(0.008, abs=2.0 * size.error)
    traces = traces_of(found, effects_of(found))
    missing = [
        np.concatenate([t.stretch.torque - p for t, p in zip(traces, each, strict=True)])
        for each in ([t.before for t in traces], [t.after for t in traces])
    ]
    assert np.std(missing[0]) > 2.0 * np.std(missing[1]), "skews off the data sheet are not held against the cause"


@slow
def test_torques_behind_filters_of_one_kind_are_told_on_both_shafts() -> None:
    """Noise of the torque goes through the filters, too."""
    filters = butter(2, 50.0, fs=MILLISECONDS, output="sos")

    def filtered(torque: Array) -> Array:
        return np.asarray(torque[0] + sosfilt(filters, torque - torque[0]))

    runs = tuple(replace(run, torque=run.torque.map(filtered)) for run in _clean(20261130483))
    found = diagnose_motion("filtered", runs, load_bench(), np.random.default_rng(0))
    assert found.naming is not None
    sets = (found.naming.best, *found.naming.rivals)
    assert {(fit.identifier, fit.place) for each in sets for fit in each.fits} <= {
        ("transducer_bandwidth", "both"),
        ("channel_delay", "both"),
    }
    assert found.fitted_sizes[0].value == pytest.approx(np.sqrt(2.0) / (2.0 * np.pi * 50.0), abs=1e-3)
