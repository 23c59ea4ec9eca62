"""Laws that bend: what a smooth change along a mechanism's own covariates takes up, and what it must not."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from tests.trials.strata_by_name import find_stratum

from pmg.pipeline.diagnosis.design.next_test import form_test
from pmg.pipeline.diagnosis.engine.adequacy import AdequacyTest, Remainder, adequacy_test
from pmg.pipeline.diagnosis.engine.catalogue import FORM_ERROR, MARGIN
from pmg.pipeline.diagnosis.engine.explanation import Explanation, explain_with
from pmg.pipeline.diagnosis.engine.forms import with_free_laws, with_look_alikes
from pmg.pipeline.diagnosis.engine.free_form import BENT, FreeForm, explains, free_form
from pmg.pipeline.diagnosis.engine.naming import _further, name_candidates
from pmg.pipeline.diagnosis.grid.candidates import (
    Candidate,
    CandidateFit,
    GridProblem,
    candidates,
    grid_problem,
    refinement,
)
from pmg.pipeline.diagnosis.grid.catalogue import MECHANISMS, GridExplanation
from pmg.pipeline.diagnosis.grid.evidence import campaign_evidence
from pmg.pipeline.diagnosis.grid.free_form import bent_columns, law_parts
from pmg.pipeline.diagnosis.grid.law import law_powers
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.fit.whitening import whitener
from pmg.pipeline.grid.readings import take_readings
from pmg.pipeline.trials.nature import draw_case, measure_case
from pmg.sim.bench import load_bench
from pmg.sim.mechanisms.base import LawCovariate

if TYPE_CHECKING:
    from pmg.pipeline.diagnosis.engine.problem import WhitenedProblem
    from pmg.pipeline.fit.noise import NoiseFloor

NOISE = Remainder(0.5, 0.0, 40.0)
SEEN = Remainder(0.001, 500.0, 40.0)


@pytest.fixture(scope="module")
def measured() -> tuple[GridProblem, NoiseFloor]:
    """A campaign without an effect, and its noise."""
    rng = np.random.default_rng(5)
    bench = load_bench()
    analysis = analyse(measure_case(draw_case(find_stratum("clean"), rng), rng), AnalysisOptions(), bench)
    assert analysis.floor is not None
    assert analysis.calibration is not None
    readings = take_readings(analysis.grid, bench)
    white = whitener(readings, bench, analysis.floor)
    return grid_problem(readings, bench, analysis.calibration.model, white), analysis.floor


@pytest.fixture(scope="module")
def clean(measured: tuple[GridProblem, NoiseFloor]) -> GridProblem:
    """A campaign without an effect."""
    return measured[0]


def candidate(identifier: str, shaft: str) -> Candidate:
    (found,) = (c for c in candidates() if (c.identifier, c.shaft) == (identifier, shaft))
    return found


def planted(clean: GridProblem, identifier: str, shaft: str, size: float, bend: float) -> GridExplanation:
    """The fit of a mechanism of that size, where the readings hold its law bent by that part along its covariate."""
    fit = clean.fitted(candidate(identifier, shaft), np.array([size]))
    change = bent_columns(clean, fit)
    effect = fit.effect + bend * (change[:, 0] if change.shape[1] else 0.0)
    problem = replace(clean, left=clean.left + clean.beyond_baseline(effect))
    found = MECHANISMS.fit(problem, fit.candidate)
    return Explanation((found,), problem.take_out(found))


def judge(remainder: Remainder) -> AdequacyTest:
    """A judge that always says the same."""

    def judged(problem: WhitenedProblem[CandidateFit]) -> Remainder:
        del problem
        return remainder

    return judged


def test_a_smooth_change_along_the_load_is_taken_up_by_load_friction(clean: GridProblem) -> None:
    bound = planted(clean, "load_dependent_bearing_friction", "sun", 0.03, 0.3)
    form = free_form(bound, MECHANISMS, judge(NOISE))
    assert form is not None
    assert form.evidence > 20.0
    left = form.explanation.problem.left
    assert left @ left < 1.3 * (len(left) - form.explanation.problem.baseline.shape[1])
    assert left @ left == pytest.approx(bound.problem.left @ bound.problem.left - form.explanation.bent)
    straight = free_form(planted(clean, "load_dependent_bearing_friction", "sun", 0.03, 0.0), MECHANISMS, judge(NOISE))
    assert straight is not None
    assert straight.evidence < 5.0


def test_a_change_acts_where_the_mechanism_acts_and_nowhere_else(clean: GridProblem) -> None:
    for identifier, shaft, count in (
        ("load_dependent_bearing_friction", "ring", 2),
        ("load_dependent_iron_loss", "both", 5),
        ("residual_magnetic_coupling", "both", 2),
        ("torque_zero_offset", "sun", 0),
    ):
        chosen = candidate(identifier, shaft)
        fit = clean.fitted(chosen, np.array([p.typical for p in chosen.parameters]))
        columns = bent_columns(clean, fit)
        assert columns.shape == (len(clean.left), count)
        assert not columns[fit.effect == 0.0].any()
        assert not count or np.abs(columns).max() > 0.1 * np.abs(fit.effect).max()


def test_what_takes_a_multiple_of_a_law_is_no_change_of_it(clean: GridProblem) -> None:
    """A direction of the bend that the baseline all but absorbs shows only what a law many times as large would."""
    fit = clean.fitted(candidate("stribeck_mixed_lubrication", "ring"), np.array([0.2, 15.0]))
    beside = clean.take_out(fit)
    along, seen, _ = np.linalg.svd(beside.project(beside.white(bent_columns(clean, fit))), full_matrices=False)
    assert seen[0] > 4.0 > 0.5 > seen[-1]
    for direction, taken_up in ((along[:, 0], True), (along[:, -1], False)):
        form = free_form(Explanation((fit,), replace(beside, left=10.0 * direction)), MECHANISMS, judge(NOISE))
        assert form is not None
        assert bool(form.explanation.bent > 50.0) is taken_up
        assert bool(form.evidence > 10.0) is taken_up


@pytest.mark.parametrize(("power", "strays"), [(1.2, False), (2.2, True)])
def test_a_law_that_runs_out_of_the_range_of_its_source_is_another_law(
    power: float, *, strays: bool, clean: GridProblem
) -> None:
    detailed = refinement(candidate("load_dependent_iron_loss", "both"))
    assert detailed is not None
    values = np.array([3.0 * detailed.parameters[0].typical, 1.6, power])
    problem = replace(clean, left=clean.left + clean.beyond_baseline(clean.effect(detailed, values)))
    found = MECHANISMS.fit(problem, detailed)
    assert found.strays is strays
    assert found.bends_to_anything is strays
    explained = explains(Explanation((found,), problem.take_out(found)), NOISE)
    assert explained is not strays


def test_what_has_no_covariate_does_not_bend(clean: GridProblem) -> None:
    assert free_form(planted(clean, "torque_zero_offset", "sun", 0.02, 0.0), MECHANISMS, judge(NOISE)) is None


def test_beside_another_candidate_no_law_is_free(clean: GridProblem) -> None:
    first = planted(clean, "load_dependent_bearing_friction", "sun", 0.03, 0.3)
    second = MECHANISMS.fit(first.problem, candidate("torque_zero_offset", "ring"))
    assert free_form(first.plus(second), MECHANISMS, judge(NOISE)) is None


@pytest.mark.parametrize(
    ("bent", "remainder", "explains"),
    [
        (0.5 * BENT, NOISE, True),
        (1.5 * BENT, NOISE, False),
        (0.5 * BENT, replace(SEEN, excess=0.9 * FORM_ERROR * 1000.0), True),
        (0.5 * BENT, replace(SEEN, excess=1.1 * FORM_ERROR * 1000.0), False),
    ],
)
def test_a_bent_law_explains_while_it_is_still_that_law_and_leaves_next_to_nothing(
    bent: float, remainder: Remainder, *, explains: bool, clean: GridProblem
) -> None:
    found = planted(clean, "load_dependent_bearing_friction", "sun", 0.03, 0.0)
    fit = replace(found.fits[0], gain=1000.0)
    form = FreeForm(replace(found, fits=(fit,), bent=bent * 1000.0), remainder, 50.0)
    assert form.explains is explains
    assert form.rivals(50.0 + 0.9 * MARGIN) is explains
    assert not form.rivals(50.0 + 1.1 * MARGIN)
    assert not replace(form, evidence=-1.0).explains


def test_a_law_that_bends_is_named_alone(measured: tuple[GridProblem, NoiseFloor]) -> None:
    """No power of the load gives a friction with a waist; the second polynomial of its root does."""
    clean, floor = measured
    fit = clean.fitted(candidate("load_dependent_bearing_friction", "sun"), np.array([0.05]))
    waist = fit.effect + 0.2 * bent_columns(clean, fit)[:, 1]
    problem = replace(clean, left=clean.left + clean.beyond_baseline(waist))
    judged = adequacy_test(campaign_evidence(problem, floor, 100, np.random.default_rng(1)))
    found = with_free_laws(name_candidates(problem, MECHANISMS, judged), problem, MECHANISMS, judged)
    assert found.explained
    assert [fit.identifier for fit in found.best.fits] == ["load_dependent_bearing_friction"]
    assert found.best.bent > 20.0
    assert found.remainder.adequate


@pytest.mark.parametrize("power", [1.0, 1.45])
def test_the_power_by_which_a_law_differs_is_told(power: float, clean: GridProblem) -> None:
    simple = candidate("load_dependent_bearing_friction", "ring")
    detailed = refinement(simple)
    assert detailed is not None
    problem = replace(clean, left=clean.left + clean.beyond_baseline(clean.effect(detailed, np.array([0.05, power]))))
    (found,) = law_powers(problem, MECHANISMS.fit(problem, simple))
    assert (found.along, found.shaft) == (LawCovariate.LOAD, "ring")
    assert abs(found.more - (power - 1.0)) < 2.0 * found.standard_error
    assert found.standard_error < 0.15


def test_the_power_of_a_law_of_two_quantities_is_told_for_each(clean: GridProblem) -> None:
    simple = candidate("load_dependent_iron_loss", "both")
    detailed = refinement(simple)
    assert detailed is not None
    values = np.array([6.0 * detailed.parameters[0].typical, 1.2, 0.7])
    problem = replace(clean, left=clean.left + clean.beyond_baseline(clean.effect(detailed, values)))
    load, speed = law_powers(problem, MECHANISMS.fit(problem, simple))
    assert (load.along, speed.along) == (LawCovariate.LOAD, LawCovariate.SPEED)
    assert speed.more < -2.0 * speed.standard_error
    assert abs(speed.more + 0.3) < 3.0 * speed.standard_error
    assert abs(load.more - 0.2) < 3.0 * load.standard_error


def test_a_further_cause_is_told_from_an_error_of_form_by_points_that_no_bend_follows(
    measured: tuple[GridProblem, NoiseFloor],
) -> None:
    clean, floor = measured
    best = planted(clean, "load_dependent_bearing_friction", "sun", 0.05, 0.0)
    chosen = candidate("torque_zero_offset", "ring")
    further = clean.fitted(chosen, np.array([0.0003]))
    test = form_test(clean, best, (further,), floor)
    assert test is not None
    assert test.separates == ("load_dependent_bearing_friction", "torque_zero_offset")
    larger = form_test(clean, best, (clean.fitted(chosen, np.array([0.01])),), floor)
    assert larger is not None
    assert larger.power > max(test.power, 0.9)
    (own,) = best.fits
    same = form_test(clean, best, (clean.fitted(own.candidate, own.values),), floor)
    assert same is not None
    assert same.power < 0.05


def test_of_a_pair_of_look_alikes_either_alone_is_a_rival(clean: GridProblem) -> None:
    """Gain and crosstalk show the same under load; a small part of the other takes up an error of form of either."""
    gain = clean.fitted(candidate("torque_gain_error", "ring"), np.array([0.01]))
    other = clean.fitted(candidate("torque_crosstalk", "ring"), np.array([0.0015]))
    apart = clean.fitted(candidate("torque_zero_offset", "ring"), np.array([0.003]))

    def rivals(first: CandidateFit, second: CandidateFit) -> set[str]:
        problem = replace(clean, left=clean.left + first.seen + second.seen)
        naming = name_candidates(problem, MECHANISMS, judge(SEEN))
        pair = explain_with(problem, MECHANISMS, [first.candidate, second.candidate])
        found = with_look_alikes(replace(naming, best=pair, rivals=(), explained=True), problem)
        return {identifier for rival in found.rivals for identifier in rival.ids}

    assert rivals(gain, other) == {"torque_gain_error", "torque_crosstalk"}
    assert rivals(gain, apart) == set()


@pytest.mark.parametrize(("power", "told"), [(3.0, True), (6.0, False)])
def test_a_power_beyond_the_search_is_not_told(power: float, *, told: bool, clean: GridProblem) -> None:
    """The scale that goes with a steep power is not bounded, and a power at the end of the search is none."""
    fit = clean.fitted(candidate("windage", "sun"), np.array([1e-6]))
    (part,) = law_parts(clean, fit)
    steep = fit.effect * 40.0 * np.exp((power - 1.0) * part.logarithm(LawCovariate.SPEED))
    found = law_powers(replace(clean, left=clean.left + clean.beyond_baseline(1e3 * steep)), fit)
    assert bool(found) is told
    assert all(abs(each.more - (power - 1.0)) < 0.05 for each in found)


def test_what_joins_a_set_is_not_the_set_again_in_another_order(clean: GridProblem) -> None:
    first = planted(clean, "load_dependent_bearing_friction", "sun", 0.03, 0.0)
    offset = MECHANISMS.fit(first.problem, candidate("torque_zero_offset", "ring"))
    large = replace(offset, gain=1000.0)
    again = MECHANISMS.fit(first.problem, candidate("load_dependent_bearing_friction", "ring"))
    other = Explanation((large,), clean).plus(replace(again, gain=1000.0))
    assert not _further(first, [other])
    assert _further(first, [other, first.plus(large)]) == (large,)
