"""Runs that a campaign in motion lacks: their references, the signals they would have, and what they would tell."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tests.diagnosis.test_motion import _campaign, _with_torque

from pmg.pipeline.chapters.in_motion.page import motion_report
from pmg.pipeline.diagnosis.balance.fitting import TermFit
from pmg.pipeline.diagnosis.engine.explanation import Explanation, explain_with
from pmg.pipeline.diagnosis.engine.separation import power_to_separate, squares_beyond
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.motion import naming
from pmg.pipeline.diagnosis.motion.candidates.library import library
from pmg.pipeline.diagnosis.motion.candidates.like_filter import scatter_beside
from pmg.pipeline.diagnosis.motion.catalogue import MotionCatalogue
from pmg.pipeline.diagnosis.motion.compressed import scatter_beyond
from pmg.pipeline.diagnosis.motion.decide import diagnose_motion
from pmg.pipeline.diagnosis.motion.design.foresight import Foresight
from pmg.pipeline.diagnosis.motion.design.next_runs import NextRun, merged, run_to_confirm
from pmg.pipeline.diagnosis.motion.design.proposals import Proposal, proposals
from pmg.pipeline.diagnosis.motion.design.proposed_run import ProposedRun, Reference, Swing, _with_turning, with_runs
from pmg.pipeline.diagnosis.motion.design.unseen import smallest_told, unseen
from pmg.pipeline.diagnosis.motion.document import motion_document
from pmg.pipeline.diagnosis.motion.evidence import OFF_SHEET, MotionEvidence, motion_evidence
from pmg.pipeline.diagnosis.motion.fitted import fit_constants
from pmg.pipeline.diagnosis.motion.noise.row_noise import SlowNoise
from pmg.pipeline.recording.run_records import Manoeuvre
from pmg.sim.bench import load_bench
from pmg.sim.grid import Configuration
from pmg.sim.signals import RPM

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.motion.candidates.terms import MotionTerm

TIME = np.arange(0.0, 30.0, 1.0 / 250.0)
SLOW_NOISE = SlowNoise(ripple=(1e-3, 1e-3))


def test_a_reference_is_told_as_it_is_set_on_a_bench() -> None:
    speed = Reference("sun", "speed", (0.0, 1.0, 14.0), (0.0, 0.0, 100.0 * RPM))
    swing = Swing(0.25, 0.5, 25.0, 2.0, 14.0)
    load = Reference("ring", "torque", (0.0, 14.0), (1.0, 1.0), (swing,))
    run = ProposedRun("loaded", Manoeuvre.SWEEP, 14.0, speed, load)
    assert run.configuration is Configuration.ENGAGED
    assert run.words == (
        "sun speed [rpm] 0, held 1 s, to 100 in 13 s; "
        "ring torque [N m] 1.00, held 14 s, ± 0.25 at 0.5 to 25 Hz from 2 to 14 s"
    )
    assert ProposedRun("zero", Manoeuvre.ZERO, 6.0).configuration is Configuration.ZERO


@given(st.floats(0.2, 2.0), st.floats(1.0, 20.0), st.floats(0.1, 5.0))
@settings(max_examples=25)
def test_a_swing_goes_from_its_first_frequency_to_its_last(first: float, octaves: float, size: float) -> None:
    swing = Swing(size, first, first * octaves, 2.0, 28.0)
    frequency, course = swing.frequency(TIME), swing.course(TIME)
    assert frequency[0] == pytest.approx(first)
    assert frequency[-1] == pytest.approx(first * octaves)
    assert np.abs(course).max() <= size
    assert not course[(TIME < 2.0) | (TIME > 28.0)].any()
    turns = np.count_nonzero(np.diff(np.signbit(course[(TIME >= 2.0) & (TIME <= 28.0)])))
    even = first * 26.0 * (octaves - 1.0) / math.log(octaves) if octaves > 1.0 else first * 26.0
    assert turns == pytest.approx(2.0 * even, abs=2.0)


@pytest.fixture(scope="module")
def forward() -> MotionEvidence:
    """A campaign that never turned backwards."""
    return _evidence((0, 1, 2, 5))


def _evidence(kept: tuple[int, ...]) -> MotionEvidence:
    runs = tuple(run for k, run in enumerate(_campaign(24)) if k in kept)
    before, _, noise = fit_constants(runs, load_bench())
    return motion_evidence(before, noise, library(), np.random.default_rng(0))


def test_rows_are_in_units_of_their_scatter_beside_faults_of_transducers_and_withheld_ones_hold_what_these_do(
    forward: MotionEvidence,
) -> None:
    """Columns of gains and lags hold noise of the torque that they are made of: it is there in withheld rows."""
    families = zip(forward.families, forward.evidence.families, strict=True)
    looked = np.hstack([forward.columns, *(each for family, each in families if family.configuration != OFF_SHEET)])
    searched = (forward.block < len(forward.baseline.stretches)) | forward.of_sheet
    assert forward.evidence.excluded is not None
    whole = np.hstack([forward.columns, *forward.evidence.families, forward.evidence.excluded])
    seen = scatter_beyond(forward.y[searched], whole[searched])
    assert seen == pytest.approx(1.0, abs=0.02) if forward.scatter > 1.0 else seen <= 1.0
    withheld = scatter_beyond(forward.y[searched], np.hstack([looked, forward.granted])[searched])
    assert withheld == pytest.approx(scatter_beside(forward, Explanation((), forward.problem)), rel=0.02)
    assert withheld > scatter_beyond(forward.y[searched], np.hstack([looked, forward.evidence.excluded])[searched])


def test_a_run_that_was_not_made_has_the_torque_of_the_constants_and_the_speed_that_is_asked_for(
    forward: MotionEvidence,
) -> None:
    for proposal in proposals(forward.baseline, ("sun", "ring")):
        whole, first = _with_turning(forward.baseline, proposal.runs)
        assert len(whole.stretches) > first
        for place in range(first, len(whole.stretches)):
            stretch = whole.stretches[place]
            rms = float(np.sqrt(np.mean(stretch.torque**2)))
            assert float(np.sqrt(np.mean(whole.missing(place) ** 2))) <= 0.01 * rms + 1e-4, proposal.title
            (run,) = (each for each in proposal.runs if each.name == stretch.run.run.point)
            if run.speed is not None and stretch.side == run.speed.side:
                asked = max(abs(value) for value in run.speed.values)
                assert float(np.abs(stretch.shaft.speed).max()) == pytest.approx(asked, rel=0.3)


def test_what_a_run_is_foreseen_to_tell_is_what_it_tells_when_it_is_made(forward: MotionEvidence) -> None:
    """Smallest drag in one sense that is told: foreseen from a run like the one left out, and with that one."""
    made = _evidence((0, 1, 2, 3, 5))
    top = (0.0, 1.0, 5.2, 6.8, 11.0, 12.0), (0.0, 0.0, -150.0, -150.0, 0.0, 0.0)
    ramp = ProposedRun("backwards", Manoeuvre.RAMP, 12.0, Reference("sun", "speed", *top))
    ahead = Foresight(forward, Proposal("Backwards", (ramp,)), SLOW_NOISE)
    key = "direction_dependent_friction/sun/"

    def smallest(found: MotionEvidence, foresight: Foresight | None) -> float:
        tabled = found.problem.tables[key]
        new = np.zeros((0, *tabled.columns.shape[1:]))
        if foresight is not None:
            rows = [foresight.rows_of(cast("MotionTerm", tabled.term), float(shape)) for shape in tabled.shapes]
            new = np.stack(rows, axis=1)
        whole = np.concatenate([tabled.columns, new])
        columns = found.columns if foresight is None else foresight.columns
        left = squares_beyond(whole.reshape(len(whole), -1), columns)
        return smallest_told(np.sqrt(left).reshape(whole.shape[1:]), tabled)

    before, foreseen, after = smallest(forward, None), smallest(forward, ahead), smallest(made, None)
    assert after < 0.1 * before
    assert foreseen == pytest.approx(after, rel=0.5)


def test_a_campaign_that_cannot_see_is_told_the_run_that_shows_with_its_power() -> None:
    runs = tuple(run for k, run in enumerate(_campaign(24)) if k in (0, 1, 2, 5))
    found = diagnose_motion("one way", runs, load_bench(), np.random.default_rng(0))
    assert found.verdict is Verdict.CONFOUNDED
    (test,) = motion_document(found)["next_tests"]
    assert test["description"].startswith("Ramp of the sun in neutral, backwards: sun speed [rpm] 0, held 1 s, to -17")
    assert test["separates"] == ["direction_dependent_friction"]
    assert test["power"] > 0.95
    assert test["minutes"] == pytest.approx(0.75)
    told = motion_document(found)["statement"]
    assert "backwards (1 min; it would show what these runs cannot in 100% of cases)" in told
    assert "drag that differs between the senses on the sun shaft" in told


def test_what_the_search_set_aside_may_be_what_a_run_would_show(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a campaign that cannot see it and holds something that no candidate explains."""
    key = "direction_dependent_friction/sun/"

    def aside(found: MotionEvidence) -> MotionEvidence:
        tables = {each: table for each, table in found.problem.tables.items() if each != key}
        return replace(found, problem=replace(found.problem, tables=tables))

    monkeypatch.setattr(naming, "without_opposed", aside)
    hum = [0.03 * np.sin(2.0 * np.pi * 7.3 * np.arange(len(run.torque.sun)) / 1000.0) for run in _campaign(24)]
    runs = tuple(_with_torque(run, hum[k] * run.turns.sun) for k, run in enumerate(_campaign(24)) if k in (0, 1, 2, 5))
    found = diagnose_motion("one way", runs, load_bench(), np.random.default_rng(0))
    assert found.mismatch.found
    assert found.verdict is Verdict.CONFOUNDED
    assert key in {spot.term.key for spot in found.unseen}
    assert any("backwards" in run.description for run in found.next_runs)


def test_a_power_counts_how_often_evidence_that_scatters_exceeds_its_margin() -> None:
    """The difference of two sums of squares in unit noise, the true mean apart by so much, against what is said."""
    rng = np.random.default_rng(5)
    apart = np.r_[np.full(40, 4.0 / math.sqrt(40.0)), np.zeros(20)]
    noise = rng.standard_normal((20000, 60))
    gap = np.sum((noise + apart) ** 2, axis=1) - np.sum(noise**2, axis=1)
    said = power_to_separate(float(apart @ apart))
    assert float(np.mean(gap > 10.0)) == pytest.approx(said, abs=0.01)
    assert power_to_separate(16.0, 30.0) < said < power_to_separate(100.0)


def test_a_run_that_tells_several_causes_apart_stands_once_with_its_least_power() -> None:
    one, other = (NextRun("Ramp", "Ramp: up", 1.0, (name,), (), power) for name, power in (("a", 0.9), ("b", 0.5)))
    (both,) = merged((one, other))
    assert (both.separates, both.power) == (("a", "b"), 0.5)


def test_a_named_cause_is_confirmed_by_the_run_that_shows_it_and_one_too_small_by_none(forward: MotionEvidence) -> None:
    term = forward.problem.tables["direction_dependent_friction/sun/"].term

    def of_size(size: float) -> TermFit:
        return TermFit(term, 1.0, 1.0, np.zeros(0), (), np.full(len(term.amplitudes), size), math.nan)

    found = run_to_confirm(forward, (of_size(0.3),), SLOW_NOISE)
    assert found is not None
    assert {run.speed.side for run in found.runs if run.speed is not None} == {"sun"}
    assert any(min(run.speed.values) < 0.0 for run in found.runs if run.speed is not None), "this campaign went forward"
    assert found.rivals == ((),)
    assert run_to_confirm(forward, (of_size(1e-3),), SLOW_NOISE) is None
    ahead = Foresight(forward, next(p for p in proposals(forward.baseline, ("sun",)) if len(p.runs) > 1), SLOW_NOISE)
    one, thrice = (ahead.evidence_for((of_size(size),)) for size in (0.1, 0.3))
    assert thrice == pytest.approx(9.0 * one)


def test_where_no_run_tells_a_check_by_hand_is_the_next_test() -> None:
    """And a run that would tell in hardly any case is not asked for."""
    found = diagnose_motion("lagging", _campaign(12, lag=0.014), load_bench(), np.random.default_rng(0))
    assert found.naming is not None
    crosstalk = [found.evidence.problem.tables["torque_crosstalk/sun/"].term]
    rival = explain_with(found.evidence.problem, MotionCatalogue(), crosstalk)
    for power in (0.01, 0.9):
        run = NextRun("Ramp", "Ramp: up", 1.0, ("torque_crosstalk",), (), power)
        open_ = replace(found.naming, rivals=(rival,))
        told = motion_document(replace(found, verdict=Verdict.AMBIGUOUS, naming=open_, next_runs=(run,)))
        (test,) = told["next_tests"]
        assert test["description"].startswith("Ramp: up" if power > 0.5 else "By hand: load the ring shaft by a lever")
        assert test["separates"] == ["torque_crosstalk"]
        assert test["power"] == (power if power > 0.5 else None)
        proposed = replace(found, next_runs=(run,))
        page = motion_report(proposed, motion_document(proposed), (), (), note="", provenance=())
        assert page.sheet is not None
        (answer,) = (each for each in page.sheet.answers if each.question == "Next test")
        assert answer.grounds == ("next-tests" if power > 0.5 else ""), "a link to runs that are listed"


def test_runs_can_be_proposed_where_the_fit_knows_nothing_of_a_shaft(forward: MotionEvidence) -> None:
    """An inertia that no run shows may be fitted to anything, and a pull-out torque too."""
    sheet, values = forward.baseline.sheet, forward.baseline.values.copy()
    values[[sheet.at("inertia_ring"), sheet.at("pull_out")]] = -1e-3
    unknown = replace(forward.baseline, values=values)
    for proposal in proposals(unknown, ("sun", "ring")):
        whole, first = with_runs(unknown, proposal.runs)
        sizes = [float(np.abs(stretch.torque).max()) for stretch in whole.stretches[first:]]
        assert sizes, proposal.title
        assert np.isfinite(sizes).all(), proposal.title


def test_a_large_difference_does_not_make_a_campaign_blind(forward: MotionEvidence) -> None:
    """What scatters the rows is there to be seen; what the runs could show is a matter of the runs."""
    scattered = replace(
        forward,
        scatter=10.0 * forward.scatter,
        problem=replace(
            forward.problem,
            tables={k: replace(t, columns=t.columns / 10.0) for k, t in forward.problem.tables.items()},
        ),
    )
    assert [spot.ids for spot in unseen(scattered)] == [spot.ids for spot in unseen(forward)]
    assert [spot.smallest for spot in unseen(scattered)] == pytest.approx([spot.smallest for spot in unseen(forward)])
