"""Truths planted by a bench of other functional forms, with correlated noise, and found again."""

from __future__ import annotations

import json
from dataclasses import replace

import jsonschema
import numpy as np
import pytest
from tests.conftest import ROOT
from tests.nature import Nature, campaign_points, measure
from tests.slow import slow

from pmg.pipeline.diagnosis.design.blind import confounded_shafts
from pmg.pipeline.diagnosis.engine.verdict import Verdict
from pmg.pipeline.diagnosis.grid.decide import diagnose
from pmg.pipeline.diagnosis.grid.document import diagnosis_document
from pmg.pipeline.diagnosis.grid.locate import find_mismatch
from pmg.pipeline.fit.analysis import Analysis, analyse
from pmg.pipeline.fit.options import AnalysisOptions
from pmg.pipeline.grid.readings import take_readings
from pmg.sim.bench import BenchParameters
from pmg.sim.grid import Grid

NATURE = Nature()
SCHEMA = ROOT / "pipeline" / "diagnosis" / "diagnosis.schema.json"


def analysed(grid: Grid, bench: BenchParameters) -> Analysis:
    analysis = analyse(grid, AnalysisOptions(), bench)
    assert not analysis.missing
    return analysis


def p_value(grid: Grid, bench: BenchParameters, rng: np.random.Generator) -> float:
    analysis = analysed(grid, bench)
    assert analysis.fits is not None
    assert analysis.floor is not None
    return find_mismatch(analysis.grid, analysis.fits, analysis.floor, bench, rng, draws=99).p_value


@pytest.mark.parametrize("order", ["random", pytest.param("falling", marks=slow)])
def test_false_alarms_stay_at_their_stated_rate(order: str, bench: BenchParameters, rng: np.random.Generator) -> None:
    """40 clean campaigns at 5 %: more than 6 alarms would happen once in 290 times, at a rate of 30 % in 98 of 100."""
    p = [p_value(measure(NATURE, campaign_points(order, rng), rng)[0], bench, rng) for _ in range(40)]
    assert sum(value <= 0.05 for value in p) <= 6
    # And the p-values are not simply all large: so few below a half would happen once in 900 times.
    assert sum(value <= 0.5 for value in p) > 10


def test_the_uncertainty_of_a_point_covers_noise_and_wander(bench: BenchParameters, rng: np.random.Generator) -> None:
    inside = []
    for _ in range(12):
        grid, true_sun, true_ring = measure(NATURE, campaign_points("random", rng), rng)
        result = analysed(grid, bench).grid
        moving_ring = ~(grid.points.neutral & grid.points.rest_ring)
        inside += list(np.abs(grid.torque_sun - true_sun) <= 2.0 * result.u_sun)
        inside += list((np.abs(grid.torque_ring - true_ring) <= 2.0 * result.u_ring)[moving_ring])
    assert 0.93 < np.mean(inside) < 0.97


def test_calibration_finds_the_constants_within_their_errors(bench: BenchParameters, rng: np.random.Generator) -> None:
    score = []
    for _ in range(12):
        grid, _, _ = measure(NATURE, campaign_points("random", rng), rng)
        calibration = analysed(grid, bench).calibration
        assert calibration is not None
        for name, truth in (("K_corr", NATURE.bearing_part), ("c", NATURE.eddy)):
            error = calibration.standard_error(name)
            if error is not None:
                score.append((calibration.value(name) - truth) / error)
    assert len(score) > 12
    assert np.sqrt(np.mean(np.square(score))) < 1.6


def thermal_factor(at_started: np.ndarray, power: np.ndarray) -> np.ndarray:
    """Drag of a bearing whose lubricant thins as it warms: temperature step by step, 25 min time constant."""
    temperature, out = 30.0, []
    for i in range(len(power)):
        out.append(np.exp(-0.02 * (temperature - 38.0)))
        step = at_started[min(i + 1, len(power) - 1)] - at_started[i]
        temperature += step / 1500.0 * (22.0 + 1.3 * power[i] - temperature)
    return np.array(out)


def test_a_warming_ring_bearing_is_located(bench: BenchParameters, rng: np.random.Generator) -> None:
    at = campaign_points("random", rng)
    power = NATURE.drag(NATURE.ring, at.speed_ring) * np.abs(at.speed_ring)
    grid, _, _ = measure(NATURE, at, rng, ring_factor=thermal_factor(at.started_at, power))
    analysis = analysed(grid, bench)
    assert analysis.fits is not None
    assert analysis.floor is not None
    assert analysis.calibration is not None
    found = diagnose(analysis.grid, analysis.fits, analysis.floor, analysis.calibration, bench, rng)
    assert found.verdict is Verdict.NAMED
    assert found.naming is not None
    assert found.naming.shafts == {"lubricant_viscosity": "ring"}
    first = found.mismatch.locations[0]
    assert (first.signal, first.configuration) == ("torque_ring", "neutral")
    assert {"run_history", "order"} & set(first.depends_on)
    assert found.held_out is not None
    assert found.held_out.gain_interval[0] > 0.0
    # What is no cause gains nothing beside it.
    assert found.held_out.placebo_gain is not None
    assert found.held_out.placebo_gain < 0.05 * (found.held_out.rmse_before - found.held_out.rmse_after)
    assert found.decoys is not None
    assert found.decoys.passed <= 0.05 * found.decoys.count
    # Repeats carry the slow change; the floor must not swallow it.
    assert analysis.floor.ring.u < 2.0 * np.hypot(NATURE.wander, NATURE.white)


def test_a_gain_error_is_located_in_the_engaged_load(bench: BenchParameters, rng: np.random.Generator) -> None:
    grid, _, _ = measure(NATURE, campaign_points("random", rng), rng, sun_gain=0.02)
    analysis = analysed(grid, bench)
    assert analysis.fits is not None
    assert analysis.floor is not None
    found = find_mismatch(analysis.grid, analysis.fits, analysis.floor, bench, rng)
    first = found.locations[0]
    assert (first.signal, first.configuration) == ("torque_sun", "engaged")
    assert "load" in first.depends_on


def test_an_offset_is_told_by_what_keeps_its_sign(bench: BenchParameters, rng: np.random.Generator) -> None:
    grid, _, _ = measure(NATURE, campaign_points("random", rng), rng, sun_offset=8e-3)
    analysis = analysed(grid, bench)
    assert analysis.fits is not None
    assert analysis.floor is not None
    found = find_mismatch(analysis.grid, analysis.fits, analysis.floor, bench, rng)
    assert found.locations[0].signal == "torque_sun"
    assert found.locations[0].depends_on[0] == "direction"


def test_one_wild_point_is_named(bench: BenchParameters, rng: np.random.Generator) -> None:
    grid, _, _ = measure(NATURE, campaign_points("random", rng), rng)
    torque = grid.torque_sun.copy()
    wild = int(np.flatnonzero(grid.points.neutral & (grid.points.speed_sun > 100.0))[17])
    torque[wild] += 0.0065
    analysis = analysed(replace(grid, torque_sun=torque), bench)
    assert analysis.fits is not None
    assert analysis.floor is not None
    assert not analysis.outliers, "it is not so far off that it takes no part in the fits"
    found = find_mismatch(analysis.grid, analysis.fits, analysis.floor, bench, rng)
    assert found.found
    effect = found.locations[0].effect
    assert found.readings.row[int(np.argmax(np.abs(effect)))] == wild


def test_an_order_that_is_the_speed_without_repeats_is_called_confounded(
    bench: BenchParameters, rng: np.random.Generator
) -> None:
    at = campaign_points("falling", rng)
    _, first = np.unique(
        np.stack([np.round(at.speed_sun), np.round(at.speed_ring), at.load_set, at.engaged], axis=1),
        axis=0,
        return_index=True,
    )
    once = at[np.sort(first)]
    once = once[~once.zero & (once.speed_sun >= 0.0)]
    analysis = analysed(measure(NATURE, once, rng)[0], bench)
    assert analysis.fits is not None
    assert analysis.floor is not None
    assert analysis.calibration is not None
    found = diagnose(analysis.grid, analysis.fits, analysis.floor, analysis.calibration, bench, rng)
    assert found.verdict is Verdict.CONFOUNDED
    document = diagnosis_document(found)
    jsonschema.validate(document, json.loads(SCHEMA.read_text()))
    again = document["next_tests"][0]["points"]  # ten set-points, hot and cold, would show too small a part of it
    assert len(again) == len(once)
    grid, _, _ = measure(NATURE, campaign_points("random", rng), rng)
    assert confounded_shafts(take_readings(grid, bench)) == ()
    assert confounded_shafts(take_readings(measure(NATURE, once, rng)[0], bench)) == ("sun",)
