"""Mechanisms planted by the proving bench, which shares no form with the catalogue, named again."""

from __future__ import annotations

import json
from dataclasses import replace

import jsonschema
import numpy as np
import pytest
from tests.recovery.test_planted import SCHEMA
from tests.trials.strata_by_name import find_stratum

from pmg.pipeline.diagnosis.engine.catalogue import WEAK
from pmg.pipeline.diagnosis.engine.free_form import explains
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.grid.candidates import CandidateFit, candidates, grid_problem
from pmg.pipeline.diagnosis.grid.decide import diagnose
from pmg.pipeline.diagnosis.grid.diagnosis import Diagnosis
from pmg.pipeline.diagnosis.grid.document import diagnosis_document
from pmg.pipeline.diagnosis.grid.fitting import fit_candidate
from pmg.pipeline.diagnosis.grid.law import LawPower
from pmg.pipeline.diagnosis.grid.statement import statement
from pmg.pipeline.fit.analysis import analyse
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.fit.whitening import whitener
from pmg.pipeline.grid.readings import take_readings
from pmg.pipeline.trials.nature import draw_case, measure_case
from pmg.sim.bench import BenchParameters
from pmg.sim.mechanisms.base import LawCovariate


def diagnosed(stratum: str, bench: BenchParameters, seed: int) -> Diagnosis:
    rng = np.random.default_rng(seed)
    grid = measure_case(draw_case(find_stratum(stratum), rng), rng)
    analysis = analyse(grid, AnalysisOptions(), bench)
    assert analysis.fits is not None
    assert analysis.floor is not None
    assert analysis.calibration is not None
    return diagnose(analysis.grid, analysis.fits, analysis.floor, analysis.calibration, bench, rng)


@pytest.mark.parametrize(
    ("identifier", "shaft", "seen_on"),
    [
        ("relative_bearing_drag", "both", "both"),
        ("torque_zero_offset", "sun", "sun"),
        ("stribeck_mixed_lubrication", "sun", "sun"),
        ("load_dependent_bearing_friction", "ring", "either"),
    ],
)
def test_a_planted_mechanism_is_named(identifier: str, shaft: str, seen_on: str, bench: BenchParameters) -> None:
    found = diagnosed(f"{identifier} {shaft} 2", bench, 1000)
    assert found.verdict is Verdict.NAMED
    assert found.naming is not None
    assert found.naming.shafts == {identifier: seen_on}
    assert found.held_out is not None
    assert found.held_out.rmse_after < 2.0 * found.held_out.noise_floor
    assert found.held_out.rmse_after < 0.7 * found.held_out.rmse_before
    document = diagnosis_document(found)
    assert [row["id"] for row in document["mechanisms"]] == [identifier]
    assert "Cause: " in statement(found)
    best, (other, *_) = found.naming.best, (fit for fit in found.naming.ranking if fit.identifier != identifier)
    assert "law differs" not in statement(found)
    assert document["form"] is None
    rest = replace(found.naming.remainder, excess=0.0)
    naming = replace(found.naming, best=replace(best, bent=best.gain / 9.0), further=(other,), remainder=rest)
    power = LawPower(identifier, "sun", LawCovariate.LOAD, 0.4, 0.1)
    bent = replace(found, naming=naming, law=(power, replace(power, more=-0.1)))
    assert "The library's form explains 90.0% " in statement(bent)
    assert "With load it goes by a power 0.40 ± 0.10 higher than the fitted form." in statement(bent)
    assert "lower than" not in statement(bent)
    assert f"or {other.candidate.kind.title[0].lower()}{other.candidate.kind.title[1:]}" in statement(bent)
    whole = diagnosis_document(bent)
    jsonschema.validate(whole, json.loads(SCHEMA.read_text(encoding="utf-8")))
    form = whole["form"]
    assert form["or_further"] == [other.identifier]
    assert form["powers"][0] == {
        "id": identifier,
        "shaft": "sun",
        "along": "load",
        "value": 0.4,
        "standard_error": 0.1,
    }


def test_a_twin_under_one_way_flow_is_ambiguous_with_the_test_that_tells(bench: BenchParameters) -> None:
    found = diagnosed("one-way flow, load_dependent_bearing_friction sun 2", bench, 1000)
    assert found.verdict is Verdict.AMBIGUOUS
    document = diagnosis_document(found)
    assert {"torque_gain_error", "load_dependent_bearing_friction"} <= {row["id"] for row in document["mechanisms"]}
    assert sum(row["probability"] for row in document["mechanisms"]) == pytest.approx(1.0, abs=0.01)
    assert any("ring motor driving" in test["description"] and test["power"] > 0.9 for test in document["next_tests"])
    assert "cannot tell between" in statement(found)


def test_what_is_outside_the_catalogue_is_not_named(bench: BenchParameters) -> None:
    found = diagnosed("outside_previous_speed sun 2", bench, 1000)
    assert found.verdict is Verdict.NOT_IN_LIBRARY
    assert not diagnosis_document(found)["mechanisms"]
    assert "No mechanism of the catalogue" in statement(found)
    naming = found.naming
    assert naming is not None
    first, left = naming.ranking[0], naming.remainder
    best = replace(naming.best, fits=(first,))
    rounds = (replace(naming.rounds[0], remainder=replace(left, excess=0.9 * WEAK)),)
    nothing = replace(found, naming=replace(naming, best=best, remainder=replace(left, excess=first.gain)))
    close = replace(found, naming=replace(naming, best=best, remainder=replace(left, excess=0.1 * first.gain)))
    weak = replace(naming, best=best, rounds=rounds)
    faint = replace(found, naming=weak)
    assert not diagnosis_document(nothing)["rivals"]
    (row,) = diagnosis_document(close)["rivals"]
    assert row["ids"] == [first.identifier]
    assert "91% of the difference" in row["why"]
    assert len(diagnosis_document(faint)["rivals"]) == 2
    assert "No cause can be named. It may be " in statement(faint)
    proof = found.held_out
    assert proof is not None
    plain = replace(faint, held_out=replace(proof, gain_interval=(0.6 * proof.rmse_before, proof.rmse_before)))
    assert "No cause can be named" not in statement(plain), "a curve predicts most of it on data not used"
    small = replace(weak, rounds=(replace(rounds[0], ranking=(replace(first, gain=0.1 * WEAK),)),))
    assert not diagnosis_document(replace(faint, naming=small))["rivals"]
    assert "No cause can be named: " in statement(replace(faint, naming=small))


def test_a_hump_of_drag_is_no_thin_film_that_leaves_the_bearings_driving_the_shaft(bench: BenchParameters) -> None:
    found = diagnosed("outside_drag_hump ring 2", bench, 1000)
    assert found.verdict is Verdict.NOT_IN_LIBRARY
    naming = found.naming
    assert naming is not None
    assert naming.best.ids == {"stribeck_mixed_lubrication"}
    assert explains(naming.best, naming.remainder)
    assert not naming.explained


def test_a_candidate_taken_out_leaves_nothing_of_itself(bench: BenchParameters) -> None:
    rng = np.random.default_rng(3)
    grid = measure_case(draw_case(find_stratum("torque_gain_error sun 4"), rng), rng)
    analysis = analyse(grid, AnalysisOptions(), bench)
    assert analysis.floor is not None
    assert analysis.calibration is not None
    readings = take_readings(analysis.grid, bench)
    problem = grid_problem(readings, bench, analysis.calibration.model, whitener(readings, bench, analysis.floor))
    gain = next(c for c in candidates() if (c.identifier, c.shaft) == ("torque_gain_error", "sun"))
    fit: CandidateFit = fit_candidate(problem, gain)
    after = problem.take_out(fit)
    assert fit_candidate(after, gain).gain < 1e-6 * fit.gain
    assert fit.gain == pytest.approx(float(problem.left @ problem.left) - float(after.left @ after.left), rel=1e-6)
